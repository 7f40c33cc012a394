//! Pictures onto the screen, and what that tells: pictures a second, latency, the title.

use super::ViewError;
use super::crop;
use super::exchange::{Wake, lock};
use super::input::Command;
use super::keymap::{Hold, Tap};
use super::plain::Shot;
use super::screen::{Presented, Screen};
use super::screenshot;
use super::sides::{self, Side};
use super::status::{Level, Measured, Status};
use super::ui::Content;
use super::window::Viewer;
use crate::image::recipe::Recipe;
use glam::UVec2;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::event_loop::ActiveEventLoop;

/// Between pictures of a view that rests, if presenting takes CPU time from tracing.
const SOFTWARE_PACE: Duration = Duration::from_millis(80);
/// Between changes of the title.
const TITLE_PACE: Duration = Duration::from_millis(500);
/// Latencies that median and percentile are taken of.
const LATENCIES: usize = 256;

impl Viewer {
    /// Takes what the engine has published.
    pub(super) fn take_published(&mut self) {
        let Some(engine) = &self.engine else { return };
        let mut published = lock(&engine.published);
        if let Some(picture) = published.picture.take() {
            published.spare = std::mem::replace(&mut self.picture, picture);
            self.asked = self.asked.or(published.asked.take());
        }
        self.moving = published.moving;
        self.layer.clone_from(&published.layer);
        self.compared.clone_from(&published.compared);
        self.status.clone_from(&published.status);
        self.loading.clone_from(&published.loading);
    }

    /// Presents at once, or later if nobody misses it and it costs CPU time.
    pub(super) fn redraw_in_time(&mut self) {
        let Some(screen) = &self.screen else { return };
        let at_rest =
            screen.software && !self.moving && self.status.as_ref().is_some_and(|s| !s.done && !s.paused);
        let last = self.presented.back().copied();
        match last.map(|last| last + SOFTWARE_PACE).filter(|&next| at_rest && next > Instant::now()) {
            Some(next) => {
                self.due.redraw.get_or_insert(next);
            }
            None => screen.window.request_redraw(),
        }
    }

    pub(super) fn redraw(&mut self) {
        if let Some(screen) = &self.screen {
            screen.window.request_redraw();
        }
    }

    pub(super) fn draw(&mut self, event_loop: &ActiveEventLoop) {
        self.take_published();
        self.due.redraw = None;
        let measured = self.measured();
        if !self.visible {
            return;
        }
        let screen_size = self.screen.as_ref().map_or(UVec2::ONE, Screen::size);
        let region = self.outlined(screen_size);
        let other = self.other();
        let Some(screen) = &mut self.screen else {
            return;
        };
        let scale_factor = screen.window.scale_factor();
        let content = Content {
            status: self.status.as_ref(),
            measured,
            loading: self.loading.as_deref(),
            notice: &self.notice,
            compared: other.as_ref().map(|(side, part)| (side.name, *part)),
            hint: self.is_new_here,
            keys: &self.options.keys,
            letters: &self.letters,
        };
        let (picture, ui, layer) = (&self.picture, &mut self.ui, &self.layer);
        let outcome = screen.draw(|bytes, size| {
            if picture.rgba.is_empty() {
                bytes.chunks_exact_mut(4).for_each(|pixel| pixel.copy_from_slice(&[24, 24, 28, 255]));
            } else {
                screenshot::scale_into(&picture.rgba, picture.size, bytes, size);
            }
            // After a resize the old layer would lie beside what it is about.
            if let Some(layer) = layer.as_ref().filter(|layer| layer.size == size && picture.size == size) {
                layer.cover(bytes);
            }
            if let Some((side, part)) = &other {
                sides::cover(bytes, size, &side.picture, *part);
            }
            if let Some(region) = region {
                crop::outline(bytes, size, region);
            }
            if !ui.is_bare(&content) {
                ui.draw(bytes, size, scale_factor, &content);
            }
        });
        let now = Instant::now();
        for (property, value) in std::mem::take(&mut self.ui.edits) {
            self.send(Command::Edit { property, value, at: now });
        }
        match outcome {
            Presented::Yes => self.was_presented(now),
            Presented::Later(pause) => self.due.redraw = Some(now + pause),
            Presented::Lost(why) => self.fail(event_loop, ViewError::Lost(why)),
        }
    }

    pub(super) fn was_presented(&mut self, now: Instant) {
        if let Some(engine) = &self.engine {
            // Who does not wait for it does not care.
            let _ = engine.presented.send(self.picture.version);
        }
        self.presented.push_back(now);
        self.response.pictures += 1;
        self.longest_pause(now);
        if let Some(asked) = self.asked.take() {
            self.latencies.push_back(now - asked);
            self.response.latencies.push(now - asked);
            if self.latencies.len() > LATENCIES {
                self.latencies.pop_front();
            }
        }
        let state = match &self.status {
            None => "loading".to_owned(),
            Some(s) if s.done => "done".to_owned(),
            Some(s) if s.paused => "paused".to_owned(),
            Some(s) => format!("{:.0} of {}", s.samples_per_pixel.floor(), s.sample_target),
        };
        let mark = if self.status.as_ref().is_some_and(|status| status.unsaved) { "*" } else { "" };
        let title = format!("{}{mark} - {state}", self.options.title);
        let is_final = self.status.as_ref().is_none_or(|s| s.done || s.paused);
        let long_ago = self.titled_at.is_none_or(|at| now - at > TITLE_PACE);
        if title != self.title
            && (is_final || long_ago)
            && let Some(screen) = &self.screen
        {
            screen.window.set_title(&title);
            self.title = title;
            self.titled_at = Some(now);
        }
    }

    /// While the view changes, pictures are counted by the time between them.
    fn longest_pause(&mut self, now: Instant) {
        let before = self.presented.iter().rev().nth(1).copied();
        if let (true, Some(before)) = (self.moving, before) {
            self.response.moving_pictures += 1;
            self.response.moving_time += now - before;
        }
    }

    /// Sorted, for the end.
    pub(super) fn measured_response(&self) -> super::Response {
        let mut response = self.response.clone();
        response.latencies.sort_unstable();
        response
    }

    pub(super) fn measured(&mut self) -> Measured {
        let now = Instant::now();
        while self.presented.front().is_some_and(|&at| now - at > Duration::from_secs(1))
            && self.presented.len() > 1
        {
            self.presented.pop_front();
        }
        let pictures_per_second = match (self.presented.front(), self.presented.back()) {
            (Some(&first), Some(&last)) if last > first => {
                (self.presented.len() - 1) as f64 / (last - first).as_secs_f64()
            }
            _ => 0.0,
        };
        let mut sorted: Vec<Duration> = self.latencies.iter().copied().collect();
        sorted.sort_unstable();
        let rank =
            |part: f64| sorted.get(((sorted.len() as f64 * part) as usize).min(sorted.len().max(1) - 1));
        let latency = rank(0.5).zip(rank(0.99)).map(|(m, w)| (m.as_secs_f64(), w.as_secs_f64()));
        Measured { pictures_per_second, latency }
    }

    /// What is shown over the picture to compare it with, and up to which part of its width.
    pub(super) fn other(&self) -> Option<(Arc<Side>, f64)> {
        let side = self.compared.side.clone()?;
        if self.held[Hold::Compare as usize] {
            return Some((side, 1.0));
        }
        self.compared.split.then_some((side, self.split))
    }

    /// The outline of the part that is refined, or is being drawn, on a screen of `size`.
    fn outlined(&self, size: UVec2) -> Option<[UVec2; 2]> {
        if self.ui.level == Level::None {
            return None;
        }
        let drawn = self.drawn_region().map(|corners| corners.map(|at| (at * size.as_dvec2()).as_uvec2()));
        drawn.map(|[a, b]| [a.min(b), a.max(b)]).or_else(|| {
            let [left, top, width, height] = self.status.as_ref().filter(|s| s.size == size)?.region?;
            Some([UVec2::new(left, top), UVec2::new(left + width, top + height)])
        })
    }

    /// The engine has made the picture of the film alone that a screenshot is of.
    pub(super) fn take_shot(&mut self, shot: &Shot) {
        let Some(screen) = &self.screen else { return };
        let (size, scale_factor) = (screen.size(), screen.window.scale_factor());
        let mut bytes = vec![0; size.element_product() as usize * 4];
        screenshot::scale_into(&shot.picture.rgba, shot.picture.size, &mut bytes, size);
        if shot.tap == Tap::ScreenshotWithHud {
            if let Some(layer) = self.layer.as_ref().filter(|layer| layer.size == size) {
                layer.cover(&mut bytes);
            }
            if let Some(region) = self.outlined(size) {
                crop::outline(&mut bytes, size, region);
            }
            let status = self.status.as_ref().map(|s| Status { kept: 0.0, smoothed: false, ..s.clone() });
            let content = Content {
                status: status.as_ref(),
                measured: self.measured(),
                loading: self.loading.as_deref(),
                notice: &self.notice,
                compared: None,
                hint: false,
                keys: &self.options.keys,
                letters: &self.letters,
            };
            if !self.ui.is_bare(&content) {
                self.ui.draw(&mut bytes, size, scale_factor, &content);
            }
        }
        self.save_screenshot(bytes, size, shot.recipe.clone());
    }

    /// What the window shows as it is.
    pub(super) fn save_shown(&mut self) {
        let Some(screen) = &self.screen else { return };
        let (bytes, size) = (screen.bytes().to_vec(), screen.size());
        self.save_screenshot(bytes, size, Recipe::default());
    }

    /// Writes a file, on a thread of its own.
    fn save_screenshot(&mut self, bytes: Vec<u8>, size: UVec2, recipe: Recipe) {
        let stem = self.options.screenshot_stem.clone();
        let proxy = self.proxy.clone();
        let writer = std::thread::spawn(move || {
            let said = match screenshot::save(&bytes, size, ".".as_ref(), &stem, &recipe) {
                Ok(path) => format!("saved {}", path.strip_prefix(".").unwrap_or(&path).display()),
                Err(why) => format!("no screenshot: {why}"),
            };
            drop(proxy.send_event(Wake::Notice(said)));
        });
        self.writers.retain(|writer| !writer.is_finished());
        self.writers.push(writer);
    }
}
