//! Between film and screen: samples of the view before that are still right, while the new ones are few.
//!
//! The film begins anew with each step of the camera, and stays what it is: unbiased. What is *shown* is a mean
//! of its samples and of those that were shown before, found again where their surface is now ([`carry`]). The
//! more samples the film has, the less the old ones count, and from [`FADE`] on it stands alone. Where no old sample is right
//! there are a few new ones for that picture alone ([`fill`]). In its first second it is also shown smoothed ([`smooth`]). None of
//! that ever touches the film, nor a picture that is finished.

mod aim;
mod carry;
mod fill;
mod grid;
mod runs;
mod smooth;

use crate::app::{FrameBudget, FrameStats};
use crate::image::compare::LinearImage;
use crate::image::develop::{Display, Picture, develop_linear};
use crate::preview::Preview;
use crate::sync::Traceable;
use crate::trace::camera::Sheet;
use crate::trace::place::{Place, Spot, places};
use crate::trace::{Film, RenderSettings, TraceScene, Viewpoint};
use bevy_ecs::prelude::*;
use glam::{UVec2, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Samples per pixel from which on the film is shown alone.
pub const FADE: u32 = 32;
/// Old samples count as so many at most.
const MOST: f32 = 32.0;
/// Time in a frame for finding out what each pixel shows.
const LOOK_TIME: Duration = Duration::from_millis(12);
/// Seconds of tracing in which a new picture is shown smoothed, ...
const SMOOTHED: f64 = 1.0;
/// ... as long as it is so noisy: below, smoothing would hide more than it shows.
const NOISY: f64 = 0.01;
/// Share of the time for a preview that carrying over takes, if it needs it.
const CARRYING: f64 = 0.85;
/// Rows between two looks at the clock.
const BAND: usize = 16;

/// What is shown of the film, and what of it can be shown from elsewhere.
#[derive(Resource, Clone, Debug, Default)]
pub struct Shown {
    /// Leave old samples alone: the film is shown as it is.
    pub only_film: bool,
    /// Do not smooth anything.
    pub never_smooth: bool,
    /// Nobody wants to see it smoothed now: two pictures are compared.
    pub hold_smoothing: bool,
    /// Seconds of tracing when this picture was begun.
    began: f64,
    /// The last picture, smoothed, if that was shown.
    smoothed: Option<Vec<Vec4>>,
    size: UVec2,
    /// From where `cells` and `spots` are seen.
    viewpoint: Option<Viewpoint>,
    /// Radiance, and how many samples it is worth. Of the last picture.
    cells: Vec<Vec4>,
    /// What is behind each pixel, to find it again.
    spots: Vec<Spot>,
    /// The same, to smooth by; as far as `exact_rows`.
    places: Vec<Place>,
    /// Rows whose spots and places are those of the pixels' middles, seen from `viewpoint`.
    exact_rows: usize,
    /// The same as `cells`, carried over from the view before; nothing of the film.
    kept: Vec<Vec4>,
    /// Whether the last picture was `kept` itself, and `cells` is an older one.
    is_kept: bool,
    /// Whether all of the last picture is seen from `viewpoint`.
    is_whole: bool,
    /// Share of the pixels that are in `kept` with old samples; 0: it holds nothing.
    share: f64,
    /// Seconds that carrying over and developing took, the last time.
    pub seconds: [f64; 2],
    /// How much one can look at in time.
    pace: grid::Pace,
    /// How often pixels that lacked samples got some.
    fills: u32,
    /// To be overwritten.
    spare: Vec<Spot>,
}

impl Shown {
    /// Forgets everything: it is of another scene, or of other light.
    pub fn forget(&mut self) {
        self.viewpoint = None;
        self.share = 0.0;
        self.exact_rows = 0;
        (self.is_kept, self.is_whole) = (false, false);
        self.seconds[0] = 0.0;
        // Other light may cost much more.
        self.pace.sample = None;
    }

    /// Share of the pixels that show old samples, in 0..=1, beside a film of so many samples per pixel.
    #[must_use]
    pub fn kept_share(&self, samples: u32, done: bool) -> f64 {
        if fade(samples, done) > 0.0 { self.share } else { 0.0 }
    }

    /// Bytes that it takes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let smoothed = self.smoothed.as_ref().map_or(0, Vec::capacity);
        (self.cells.capacity() + self.kept.capacity() + smoothed) * size_of::<Vec4>()
            + (self.spots.capacity() + self.spare.capacity()) * size_of::<Spot>()
            + self.places.capacity() * size_of::<Place>()
    }

    /// Whether the last picture was smoothed.
    #[must_use]
    pub fn is_smoothed(&self) -> bool {
        self.smoothed.is_some()
    }

    /// The last picture in linear light, as it was shown.
    #[must_use]
    pub fn image(&self) -> LinearImage {
        let cells = self.smoothed.as_deref().unwrap_or(self.cells());
        LinearImage { size: self.size, pixels: cells.iter().map(|cell| cell.truncate()).collect() }
    }

    /// The last picture before smoothing: radiance, and how many samples it is worth.
    fn cells(&self) -> &[Vec4] {
        if self.is_kept { &self.kept } else { &self.cells }
    }

    /// Whether each pixel's surface is known, so that it can be smoothed.
    fn is_looked_at(&self) -> bool {
        self.exact_rows > 0 && self.exact_rows == self.size.y as usize
    }

    /// Finds out what is behind the pixels, some rows of them.
    fn look(&mut self, scene: &TraceScene, keep_going: impl Fn() -> bool) {
        let [width, height] = self.size.to_array().map(|n| n as usize);
        let count = width * height;
        if self.viewpoint != Some(*scene.viewpoint) || self.spots.len() != count {
            self.viewpoint = Some(*scene.viewpoint);
            self.spots.clear();
            self.spots.resize(count, Spot::UNKNOWN);
            self.exact_rows = 0;
        }
        self.places.resize(count, Place::unknown());
        while self.exact_rows < height && keep_going() {
            let start = Instant::now();
            let first = self.exact_rows;
            let last = (first + BAND).min(height);
            let rows = first * width..last * width;
            self.places[rows].par_chunks_mut(width).zip(first..last).for_each(|(row, y)| {
                let middles: Vec<Vec2> =
                    (0..width).map(|x| Vec2::new(x as f32 + 0.5, y as f32 + 0.5)).collect();
                places(scene, &middles, row);
            });
            grid::note(&mut self.pace.place, start.elapsed().as_secs_f64(), (last - first) * width);
            // A row's edges are known when the one below is.
            let sheet = scene.viewpoint.sheet(self.size);
            let known = if last == height { height } else { last - 1 };
            let marked = first.saturating_sub(1)..known;
            let (places, from) = (&self.places, marked.start);
            let edges: Vec<bool> = marked
                .clone()
                .into_par_iter()
                .flat_map_iter(|y| edges(places, width, y, last, &sheet))
                .collect();
            let rows = from * width..known * width;
            for ((place, spot), edge) in
                self.places[rows.clone()].iter_mut().zip(&mut self.spots[rows]).zip(edges)
            {
                place.edge = edge;
                *spot = Spot::from(&*place);
            }
            self.exact_rows = last;
        }
        if self.is_looked_at() && !self.only_film {
            // So that the first step does not wait for memory.
            self.kept.resize(count, Vec4::ZERO);
            self.spare.resize(count, Spot::UNKNOWN);
        }
    }

    /// Brings the picture up to date, or some of it. Where there is no sample at all, `coarse` shows through.
    fn compose(
        &mut self,
        film: &Film,
        coarse: Option<&Film>,
        fade: f32,
        keep_going: impl Fn() -> bool + Sync,
    ) {
        let size = film.size();
        let width = size.x as usize;
        self.size = size;
        let count = width * size.y as usize;
        // While one moves there is nothing but what was carried over.
        let was_kept = self.is_kept;
        self.is_kept =
            self.share > 0.0 && self.kept.len() == count && fade == 1.0 && film.mean_samples() == 0.0;
        if self.is_kept {
            self.is_whole = true;
            return;
        }
        self.cells.resize(count, Vec4::ZERO);
        let fade = if self.share > 0.0 && self.kept.len() == self.cells.len() { fade } else { 0.0 };
        let kept = &self.kept;
        self.cells.par_chunks_exact_mut(width).zip(0..size.y).for_each(|(row, y)| {
            if !keep_going() {
                return;
            }
            for ((x, pixel), cell) in (0..size.x).zip(film.row(y)).zip(row) {
                let old = if fade > 0.0 { kept[y as usize * width + x as usize] } else { Vec4::ZERO };
                let (count, old_count) = (pixel.count() as f32, old.w * fade);
                let radiance = match (count > 0.0, old_count > 0.0) {
                    (true, false) => pixel.mean().as_vec3(),
                    (false, true) => old.truncate(),
                    (true, true) => {
                        let new = pixel.mean().as_vec3();
                        (new * count + old.truncate() * old_count) / (count + old_count)
                    }
                    (false, false) => coarse.map_or(Vec3::ZERO, |coarse| {
                        let small = coarse.size();
                        coarse.pixel(x * small.x / size.x, y * small.y / size.y).mean().as_vec3()
                    }),
                };
                *cell = radiance.extend(count + old_count);
            }
        });
        // Half of it may be of another view.
        self.is_kept = was_kept && self.share > 0.0 && !keep_going();
        self.is_whole |= keep_going();
    }
}

/// Which pixels of row `y` show more than one surface: what they show is of none of them. Rows below `end` are known.
fn edges<'a>(
    places: &'a [Place],
    width: usize,
    y: usize,
    end: usize,
    sheet: &'a Sheet,
) -> impl Iterator<Item = bool> + 'a {
    (0..width).map(move |x| {
        let here = &places[y * width + x];
        let pixel = 2.0 * sheet.pixel(sheet.own(here.position).z.max(0.0));
        let differs = |x: usize, y: usize| !here.continues(&places[y * width + x], pixel);
        x > 0 && differs(x - 1, y)
            || x + 1 < width && differs(x + 1, y)
            || y > 0 && differs(x, y - 1)
            || y + 1 < end && differs(x, y + 1)
    })
}

/// What an old sample counts beside a new one, if every pixel has so many new ones.
fn fade(samples: u32, done: bool) -> f32 {
    if done { 0.0 } else { (1.0 - samples as f32 / FADE as f32).max(0.0) }
}

/// After tracing: if the camera has moved, carries over what is still right; if anything else has changed,
/// forgets it. At rest, looks closer at what is there.
pub fn keep(
    inputs: Traceable,
    budget: Res<FrameBudget>,
    stats: Res<FrameStats>,
    film: Res<Film>,
    mut preview: ResMut<Preview>,
    mut shown: ResMut<Shown>,
) {
    // Asked in each frame, so that no change is overlooked.
    let is_other = inputs.scene_is_changed();
    // Smoothing asks what is behind the pixels too.
    let nobody_asks = shown.only_film && shown.never_smooth;
    if !(budget.preview && budget.develop) || nobody_asks {
        shown.forget();
        preview.reserve(Duration::ZERO);
        return;
    }
    if shown.only_film {
        shown.share = 0.0;
    }
    let scene = inputs.scene();
    if stats.begun {
        shown.began = stats.trace_seconds;
        // What a lens shows of a point, it shows from there only.
        let can_carry =
            !is_other && shown.is_whole && !scene.viewpoint.has_lens() && shown.size == film.size();
        if can_carry && !shown.only_film && shown.viewpoint.is_some_and(|old| !old.has_lens()) {
            let start = Instant::now();
            let seconds = CARRYING * preview.target();
            shown.carry(&scene, preview.film(), seconds);
            preview.reserve(start.elapsed());
            shown.seconds[0] = start.elapsed().as_secs_f64();
        } else {
            shown.forget();
            preview.reserve(Duration::ZERO);
        }
    } else if film.complete_samples() > 0 {
        let start = Instant::now();
        let keep_going = || start.elapsed() < LOOK_TIME && !budget.interrupt.load(Ordering::Relaxed);
        if shown.size == film.size() {
            shown.look(&scene, keep_going);
        }
    }
}

/// Film → [`Picture`], when either it or the way of showing it has changed.
pub fn develop_film(
    film: Res<Film>,
    preview: Res<Preview>,
    display: Res<Display>,
    (viewpoint, settings): (Res<Viewpoint>, Res<RenderSettings>),
    (stats, budget): (Res<FrameStats>, Res<FrameBudget>),
    mut shown: ResMut<Shown>,
    mut picture: ResMut<Picture>,
    mut is_late: Local<bool>,
) {
    if !(film.is_changed() || display.is_changed() || shown.is_changed() || *is_late) {
        return;
    }
    let start = Instant::now();
    let shown = shown.bypass_change_detection();
    let keep_going = || !budget.interrupt.load(Ordering::Relaxed);
    let fade = fade(film.complete_samples(), stats.done);
    shown.compose(&film, preview.film(), fade, || stats.begun || keep_going());
    // Whoever asks for another picture does not wait for this one.
    *is_late = !(stats.begun || keep_going());
    if *is_late {
        return;
    }
    let is_young = stats.trace_seconds - shown.began < SMOOTHED && !stats.done && !stats.begun;
    let is_noisy = film.complete_samples() > 0 && stats.noise.is_none_or(|noise| noise > NOISY);
    // Neighbours that share their paths have nothing left to tell each other.
    let is_shared = settings.shares_paths();
    let wanted = !(shown.never_smooth || shown.hold_smoothing || is_shared) && is_young && is_noisy;
    shown.smoothed = (wanted && shown.is_looked_at() && shown.viewpoint == Some(*viewpoint))
        .then(|| smooth::smooth(&film, &shown.cells, &shown.places, &viewpoint.sheet(shown.size), keep_going))
        .flatten();
    let picture = &mut *picture;
    picture.size = shown.size;
    let cells = shown.smoothed.as_deref().unwrap_or(shown.cells());
    picture.rgba.resize(cells.len() * 4, 255);
    develop_linear(cells, shown.size, &display, &mut picture.rgba);
    picture.version += 1;
    shown.seconds[1] = start.elapsed().as_secs_f64();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_that_is_broken_off_is_not_taken_for_one_of_its_view() {
        let film = Film::new(UVec2::splat(4), 0);
        let old = vec![Vec4::splat(5.0); 16];
        let mut shown = Shown { size: film.size(), share: 1.0, kept: old.clone(), ..Shown::default() };
        shown.compose(&film, None, 1.0, || true);
        assert!(shown.is_whole);
        assert_eq!(shown.cells(), old, "nothing but what was carried over");
        // There are samples now, and somebody asks for another picture.
        shown.compose(&film, None, 0.5, || false);
        assert!(shown.is_whole);
        assert_eq!(shown.cells(), old, "still that");
        shown.compose(&film, None, 0.5, || true);
        assert_eq!(shown.cells()[3].w, 2.5);
        shown.forget();
        shown.compose(&film, None, 1.0, || false);
        assert!(!shown.is_whole, "some of it is older");
        shown.compose(&film, None, 1.0, || true);
        assert!(shown.is_whole);
        assert_eq!(shown.cells(), [Vec4::ZERO; 16]);
    }
}
