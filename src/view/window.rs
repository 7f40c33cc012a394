//! The window's thread: events in, pictures out, never a wait.

use super::engine::{Engine, Published, Wake, lock};
use super::hud::{Canvas, Level, Measured, Place, Status, status_lines, text_scale};
use super::input::Command;
use super::keymap::{self, Action, Hold, Tap};
use super::screen::{Presented, Screen, vector};
use super::{ViewError, ViewOptions, screenshot};
use crate::app::App;
use crate::image::Picture;
use glam::{DVec2, UVec2};
use std::collections::{HashSet, VecDeque};
use std::convert::Infallible;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalPosition;
use winit::event::{
    DeviceEvent, DeviceId, ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent,
};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoopProxy};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{CursorGrabMode, WindowId};

/// A resize storm reaches the engine after this pause in it, ...
const RESIZE_PAUSE: Duration = Duration::from_millis(80);
/// ... or after this time.
const RESIZE_PATIENCE: Duration = Duration::from_millis(400);
/// Between pictures of a view that rests, if presenting takes CPU time from tracing.
const SOFTWARE_PACE: Duration = Duration::from_millis(80);
/// Between changes of the title.
const TITLE_PACE: Duration = Duration::from_millis(500);
/// How long a notice stays.
const NOTICE: Duration = Duration::from_secs(6);
/// How long a closing window waits for the engine to stop.
const FAREWELL: Duration = Duration::from_secs(2);
/// Latencies that the median is taken of.
const LATENCIES: usize = 31;
/// Pixels of a touchpad that count as a notch of a wheel.
const PIXELS_PER_NOTCH: f64 = 40.0;

/// Makes the app, on the engine's thread.
pub type Open = Box<dyn FnOnce() -> Result<App, String> + Send>;

/// The window's side of everything.
pub struct Viewer {
    options: ViewOptions,
    proxy: EventLoopProxy<Wake>,
    open: Option<Open>,
    screen: Option<Screen>,
    engine: Option<Link>,
    failure: Option<ViewError>,
    keys: HashSet<KeyCode>,
    held: [bool; Hold::COUNT],
    drag: Option<PhysicalPosition<f64>>,
    cursor: PhysicalPosition<f64>,
    visible: bool,
    picture: Picture,
    status: Option<Status>,
    moving: bool,
    asked: Option<Instant>,
    level: Level,
    help: bool,
    notice: String,
    title: String,
    titled_at: Option<Instant>,
    presented: VecDeque<Instant>,
    latencies: VecDeque<Duration>,
    resizing: Option<(UVec2, Instant)>,
    due: Due,
    writers: Vec<JoinHandle<()>>,
}

/// What is to happen later, and when.
#[derive(Clone, Copy, Debug, Default)]
struct Due {
    redraw: Option<Instant>,
    resize: Option<Instant>,
    notice: Option<Instant>,
    exit: Option<Instant>,
}

impl Due {
    fn next(self) -> Option<Instant> {
        [self.redraw, self.resize, self.notice, self.exit].into_iter().flatten().min()
    }
}

/// Takes a time that has come.
fn is_due(at: &mut Option<Instant>, now: Instant) -> bool {
    at.take_if(|at| *at <= now).is_some()
}

/// The window's ends of what connects it with the engine.
struct Link {
    commands: Sender<Command>,
    interrupt: Arc<AtomicBool>,
    published: Arc<Mutex<Published>>,
    /// Disconnected when the engine's thread has ended.
    ended: Receiver<Infallible>,
}

impl Viewer {
    /// Before the window is there.
    #[must_use]
    pub fn new(options: ViewOptions, proxy: EventLoopProxy<Wake>, open: Open) -> Self {
        Self {
            options,
            proxy,
            open: Some(open),
            screen: None,
            engine: None,
            failure: None,
            keys: HashSet::new(),
            held: [false; Hold::COUNT],
            drag: None,
            cursor: PhysicalPosition::default(),
            visible: true,
            picture: Picture::default(),
            status: None,
            moving: true,
            asked: None,
            level: Level::default(),
            help: false,
            notice: String::new(),
            title: String::new(),
            titled_at: None,
            presented: VecDeque::new(),
            latencies: VecDeque::new(),
            resizing: None,
            due: Due::default(),
            writers: Vec::new(),
        }
    }

    /// Waits for screenshots and, for a moment, for the engine.
    ///
    /// # Errors
    /// What ended the window, if it was not the user.
    pub fn finish(self) -> Result<(), ViewError> {
        for writer in self.writers {
            // It said itself what it could not write.
            let _ = writer.join();
        }
        if let Some(engine) = self.engine {
            let _ = engine.commands.send(Command::Quit);
            engine.interrupt.store(true, Ordering::SeqCst);
            // A scene that still loads cannot be interrupted, and has nothing to tidy up.
            if self.status.is_some() {
                let _: Result<Infallible, RecvTimeoutError> = engine.ended.recv_timeout(FAREWELL);
            }
        }
        self.failure.map_or(Ok(()), Err)
    }

    fn fail(&mut self, event_loop: &ActiveEventLoop, error: ViewError) {
        self.failure.get_or_insert(error);
        event_loop.exit();
    }

    fn start_engine(&mut self) {
        let Some(open) = self.open.take() else { return };
        let (commands, receiver) = channel();
        let (alive, ended) = channel();
        let interrupt = Arc::new(AtomicBool::new(false));
        let published = Arc::new(Mutex::new(Published::default()));
        let proxy = self.proxy.clone();
        let engine = Engine {
            commands: receiver,
            interrupt: Arc::clone(&interrupt),
            published: Arc::clone(&published),
            // The event loop is gone: so is who would look.
            wake: move |wake| drop(proxy.send_event(wake)),
        };
        let thread = std::thread::Builder::new().name("engine".to_owned()).spawn(move || {
            let _alive: Sender<Infallible> = alive;
            engine.run(open);
        });
        match thread {
            Ok(_) => {
                self.engine = Some(Link { commands, interrupt, published, ended });
            }
            Err(error) => drop(self.proxy.send_event(Wake::Crashed(error.to_string()))),
        }
    }

    fn send(&self, command: Command) {
        if let Some(engine) = &self.engine {
            // An engine that has ended has said why by an event.
            let _ = engine.commands.send(command);
            engine.interrupt.store(true, Ordering::SeqCst);
        }
    }

    /// Takes what the engine has published.
    fn take_published(&mut self) {
        let Some(engine) = &self.engine else { return };
        let mut published = lock(&engine.published);
        if let Some(picture) = published.picture.take() {
            published.spare = std::mem::replace(&mut self.picture, picture);
            self.asked = self.asked.or(published.asked.take());
        }
        self.moving = published.moving;
        self.status.clone_from(&published.status);
    }

    /// Presents at once, or later if nobody misses it and it costs CPU time.
    fn redraw_in_time(&mut self) {
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

    fn redraw(&mut self) {
        if let Some(screen) = &self.screen {
            screen.window.request_redraw();
        }
    }

    fn say(&mut self, text: String) {
        self.notice = text;
        self.due.notice = Some(Instant::now() + NOTICE);
        self.redraw();
    }

    fn draw(&mut self, event_loop: &ActiveEventLoop) {
        self.take_published();
        self.due.redraw = None;
        let measured = self.measured();
        if !self.visible {
            return;
        }
        let Some(screen) = &mut self.screen else {
            return;
        };
        let scale_factor = screen.window.scale_factor();
        let lines = match &self.status {
            Some(status) => status_lines(self.level, status, measured),
            None => Vec::new(),
        };
        let loading =
            self.status.is_none().then(|| [format!("loading {} ...", self.options.screenshot_stem)]);
        let outcome = screen.draw(|bytes, size| {
            if self.picture.rgba.is_empty() {
                bytes.chunks_exact_mut(4).for_each(|pixel| pixel.copy_from_slice(&[24, 24, 28, 255]));
            } else {
                screenshot::scale_into(&self.picture.rgba, self.picture.size, bytes, size);
            }
            let mut canvas = Canvas::new(bytes, size, text_scale(scale_factor, size.y));
            canvas.write(Place::Top, &lines);
            if let Some(loading) = &loading {
                canvas.write(Place::Middle, loading);
            }
            if self.help {
                canvas.write_help();
            }
            if !self.notice.is_empty() {
                canvas.write(Place::Bottom, std::slice::from_ref(&self.notice));
            }
        });
        let now = Instant::now();
        match outcome {
            Presented::Yes => self.was_presented(now),
            Presented::Later(pause) => self.due.redraw = Some(now + pause),
            Presented::Lost(why) => self.fail(event_loop, ViewError::Lost(why)),
        }
    }

    fn was_presented(&mut self, now: Instant) {
        self.presented.push_back(now);
        if let Some(asked) = self.asked.take() {
            self.latencies.push_back(now - asked);
            if self.latencies.len() > LATENCIES {
                self.latencies.pop_front();
            }
        }
        let title = match &self.status {
            None => format!("{} - loading", self.options.title),
            Some(s) if s.done => format!("{} - done", self.options.title),
            Some(s) if s.paused => format!("{} - paused", self.options.title),
            Some(s) => {
                format!("{} - {:.0} of {}", self.options.title, s.samples_per_pixel.floor(), s.sample_target)
            }
        };
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

    fn measured(&mut self) -> Measured {
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
        let latency = sorted.get(sorted.len() / 2).map(Duration::as_secs_f64);
        Measured { pictures_per_second, latency }
    }

    fn resized(&mut self, size: UVec2) {
        let Some(screen) = &mut self.screen else {
            return;
        };
        // Minimised on some systems.
        if size.min_element() == 0 {
            self.visible = false;
            return;
        }
        self.visible = true;
        screen.resize(size);
        let size = screen.size();
        let now = Instant::now();
        let since = self.resizing.map_or(now, |(_, since)| since);
        self.resizing = Some((size, since));
        self.due.resize = Some((now + RESIZE_PAUSE).min(since + RESIZE_PATIENCE));
        self.redraw();
    }

    fn key(&mut self, event_loop: &ActiveEventLoop, event: &KeyEvent, is_synthetic: bool) {
        let PhysicalKey::Code(code) = event.physical_key else {
            return;
        };
        let control = self.held[Hold::Control as usize];
        if event.state == ElementState::Released {
            self.keys.remove(&code);
            return self.hold();
        }
        let Some(binding) = keymap::lookup(code, control) else {
            return;
        };
        match binding.action {
            // Keys that are down when the window gets the focus were meant for somebody else.
            action if is_synthetic && !keymap::is_modifier(action) => {}
            Action::Hold(_) => {
                self.keys.insert(code);
                self.hold();
            }
            Action::Tap(_) if event.repeat && !binding.repeats => {}
            Action::Tap(tap) => self.tap(event_loop, tap),
        }
    }

    /// Tells the engine what is held, if that is something else than before.
    fn hold(&mut self) {
        let mut held = [false; Hold::COUNT];
        for code in &self.keys {
            if let Some(Action::Hold(hold)) = keymap::lookup(*code, false).map(|b| b.action) {
                held[hold as usize] = true;
            }
        }
        if held != self.held {
            self.held = held;
            self.send(Command::Held { held, at: Instant::now() });
        }
    }

    fn tap(&mut self, event_loop: &ActiveEventLoop, tap: Tap) {
        match tap {
            Tap::HudLevel => self.level = self.level.next(),
            Tap::Help => self.help = !self.help,
            Tap::Escape => self.help = false,
            Tap::Quit => event_loop.exit(),
            Tap::FullScreen => {
                if let Some(screen) = &self.screen {
                    screen.toggle_full_screen();
                }
            }
            Tap::Screenshot | Tap::ScreenshotWithHud => {
                self.save_screenshot(tap == Tap::ScreenshotWithHud);
            }
            tap => {
                let shift = self.held[Hold::Fast as usize];
                return self.send(Command::Tap { tap, shift, at: Instant::now() });
            }
        }
        self.redraw();
    }

    /// Writes a file on a thread of its own.
    fn save_screenshot(&mut self, with_hud: bool) {
        let Some(screen) = &self.screen else { return };
        let size = screen.size();
        let bytes = if with_hud {
            screen.bytes().to_vec()
        } else if self.picture.rgba.is_empty() {
            return self.say("there is no picture yet".to_owned());
        } else {
            self.take_published();
            let mut bytes = vec![0; size.element_product() as usize * 4];
            screenshot::scale_into(&self.picture.rgba, self.picture.size, &mut bytes, size);
            bytes
        };
        let stem = self.options.screenshot_stem.clone();
        let proxy = self.proxy.clone();
        let writer = std::thread::spawn(move || {
            let said = match screenshot::save(&bytes, size, ".".as_ref(), &stem) {
                Ok(path) => format!("saved {}", path.display()),
                Err(why) => format!("no screenshot: {why}"),
            };
            drop(proxy.send_event(Wake::Notice(said)));
        });
        self.writers.retain(|writer| !writer.is_finished());
        self.writers.push(writer);
    }

    /// Begins or ends looking around with the mouse.
    fn set_drag(&mut self, on: bool) {
        let Some(screen) = &self.screen else { return };
        if on && self.drag.is_none() {
            self.drag = Some(self.cursor);
            // X11 cannot lock the pointer: it is put back to the middle instead. Confining it as well
            // would deliver each of its motions twice.
            let _ = screen.window.set_cursor_grab(CursorGrabMode::Locked);
            screen.window.set_cursor_visible(false);
        } else if !on && let Some(start) = self.drag.take() {
            let _ = screen.window.set_cursor_position(start);
            let _ = screen.window.set_cursor_grab(CursorGrabMode::None);
            screen.window.set_cursor_visible(true);
        }
    }

    fn cursor_moved(&mut self, to: PhysicalPosition<f64>) {
        self.cursor = to;
        let (Some(_), Some(screen)) = (self.drag, &self.screen) else {
            return;
        };
        let middle = screen.size().as_dvec2() / 2.0;
        let off = (DVec2::new(to.x, to.y) - middle).abs();
        if off.cmpgt(middle / 2.0).any() {
            // Where the pointer is locked there is nothing to put back.
            let _ = screen.window.set_cursor_position(PhysicalPosition::new(middle.x, middle.y));
        }
    }

    fn leave(&mut self) {
        self.keys.clear();
        self.hold();
        self.set_drag(false);
    }
}

impl ApplicationHandler<Wake> for Viewer {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.screen.is_some() {
            return;
        }
        match Screen::open(event_loop, &self.options.title, self.options.size) {
            Ok(screen) => {
                let size = screen.size();
                self.screen = Some(screen);
                self.due.exit = self.options.exit_after.map(|time| Instant::now() + time);
                self.start_engine();
                self.send(Command::Resize(size));
                self.redraw();
            }
            Err(why) => self.fail(event_loop, ViewError::NoDisplay(why)),
        }
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, wake: Wake) {
        match wake {
            Wake::FrameReady => {
                self.take_published();
                self.redraw_in_time();
            }
            Wake::Notice(text) => self.say(text),
            Wake::OpenFailed(why) => self.fail(event_loop, ViewError::Scene(why)),
            Wake::Crashed(why) => self.fail(event_loop, ViewError::Lost(format!("internal error: {why}"))),
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => event_loop.exit(),
            WindowEvent::Destroyed => {
                // Nothing may be asked of the window any more.
                self.screen = None;
                self.fail(event_loop, ViewError::Lost("something destroyed the window".to_owned()));
            }
            WindowEvent::RedrawRequested => self.draw(event_loop),
            WindowEvent::Resized(size) => self.resized(vector(size)),
            WindowEvent::Occluded(hidden) => {
                self.visible = !hidden;
                self.redraw();
            }
            WindowEvent::Focused(false) => self.leave(),
            WindowEvent::KeyboardInput { event, is_synthetic, .. } => {
                self.key(event_loop, &event, is_synthetic);
            }
            WindowEvent::MouseInput { state, button: MouseButton::Right, .. } => {
                self.set_drag(state == ElementState::Pressed);
            }
            WindowEvent::CursorMoved { position, .. } => self.cursor_moved(position),
            WindowEvent::MouseWheel { delta, .. } => self.send(Command::Wheel(match delta {
                MouseScrollDelta::LineDelta(_, y) => f64::from(y),
                MouseScrollDelta::PixelDelta(p) => p.y / PIXELS_PER_NOTCH,
            })),
            _ => {}
        }
    }

    fn device_event(&mut self, _: &ActiveEventLoop, _: DeviceId, event: DeviceEvent) {
        if let DeviceEvent::MouseMotion { delta: (x, y) } = event
            && self.drag.is_some()
        {
            self.send(Command::Look { pixels: DVec2::new(x, y), at: Instant::now() });
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let now = Instant::now();
        if is_due(&mut self.due.redraw, now) {
            self.redraw();
        }
        if is_due(&mut self.due.resize, now)
            && let Some((size, _)) = self.resizing.take()
        {
            self.send(Command::Resize(size));
        }
        if is_due(&mut self.due.notice, now) {
            self.notice.clear();
            self.redraw();
        }
        if is_due(&mut self.due.exit, now) {
            event_loop.exit();
        }
        event_loop.set_control_flow(self.due.next().map_or(ControlFlow::Wait, ControlFlow::WaitUntil));
    }
}
