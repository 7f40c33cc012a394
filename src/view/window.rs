//! The window's thread: events in, pictures out, never a wait.

use super::chord::Letters;
use super::debug::layer::Layer;
use super::engine::Engine;
use super::exchange::{Published, Wake};
use super::input::{Command, Drag};
use super::keymap::Hold;
use super::keys::Down;
use super::replay::Event;
use super::screen::{Screen, vector};
use super::sides::Compared;
use super::status::Status;
use super::ui::Ui;
use super::ui::open::Prompt;
use super::{Response, ViewError, ViewOptions};
use crate::app::App;
use crate::image::Picture;
use crate::load::Watcher;
use glam::{DVec2, UVec2};
use std::collections::VecDeque;
use std::convert::Infallible;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalPosition;
use winit::event::{DeviceEvent, DeviceId, ElementState, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoopProxy};
use winit::window::WindowId;

/// A resize storm reaches the engine after this pause in it, ...
const RESIZE_PAUSE: Duration = Duration::from_millis(80);
/// ... or after this time.
const RESIZE_PATIENCE: Duration = Duration::from_millis(400);
/// How long a notice stays.
const NOTICE: Duration = Duration::from_secs(6);
/// How long a closing window waits for the engine to stop.
const FAREWELL: Duration = Duration::from_secs(2);

/// Makes the app, on the engine's thread.
pub type Open = Box<dyn FnOnce(Watcher) -> Result<App, String> + Send>;

/// The window's side of everything.
pub struct Viewer {
    pub(super) options: ViewOptions,
    pub(super) proxy: EventLoopProxy<Wake>,
    pub(super) open: Option<Open>,
    pub(super) screen: Option<Screen>,
    pub(super) engine: Option<Link>,
    pub(super) failure: Option<ViewError>,
    pub(super) keys: Down,
    pub(super) held: [bool; Hold::COUNT],
    /// What the mouse does, and where it began.
    pub(super) drag: Option<(Drag, PhysicalPosition<f64>)>,
    /// Whether it has gone far enough to be no click.
    pub(super) dragged: bool,
    pub(super) cursor: PhysicalPosition<f64>,
    pub(super) cursor_inside: bool,
    pub(super) letters: Letters,
    pub(super) visible: bool,
    pub(super) picture: Picture,
    pub(super) compared: Compared,
    /// Where the other picture ends if both are shown, in parts of the width.
    pub(super) split: f64,
    pub(super) layer: Option<Arc<Layer>>,
    pub(super) status: Option<Status>,
    /// What is loading, and how far it is.
    pub(super) loading: Option<String>,
    pub(super) moving: bool,
    pub(super) asked: Option<Instant>,
    pub(super) ui: Ui,
    pub(super) notice: String,
    /// The line whose file is being opened.
    pub(super) tried: Option<Prompt>,
    /// What was copied is there as long as this is.
    clipboard: Option<arboard::Clipboard>,
    /// Where the recording says that the cursor is.
    pub(super) recorded_cursor: Option<DVec2>,
    /// The user has not pressed any key yet.
    pub(super) is_new_here: bool,
    /// When the user was told that edits are not saved.
    pub(super) warned: Option<Instant>,
    pub(super) title: String,
    pub(super) titled_at: Option<Instant>,
    pub(super) presented: VecDeque<Instant>,
    pub(super) latencies: VecDeque<Duration>,
    /// All of them, and pictures in all, for who asks at the end.
    pub(super) response: Response,
    pub(super) resizing: Option<(UVec2, Instant)>,
    pub(super) due: Due,
    pub(super) writers: Vec<JoinHandle<()>>,
}

/// What is to happen later, and when.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Due {
    pub(super) redraw: Option<Instant>,
    pub(super) replay: Option<Instant>,
    pub(super) resize: Option<Instant>,
    pub(super) notice: Option<Instant>,
    pub(super) exit: Option<Instant>,
}

impl Due {
    fn next(self) -> Option<Instant> {
        [self.redraw, self.replay, self.resize, self.notice, self.exit].into_iter().flatten().min()
    }
}

/// Takes a time that has come.
fn is_due(at: &mut Option<Instant>, now: Instant) -> bool {
    at.take_if(|at| *at <= now).is_some()
}

/// The window's ends of what connects it with the engine.
pub(super) struct Link {
    pub(super) commands: Sender<Command>,
    pub(super) interrupt: Arc<AtomicBool>,
    pub(super) published: Arc<Mutex<Published>>,
    /// Versions of the pictures that have been presented.
    pub(super) presented: Sender<u64>,
    /// Disconnected when the engine's thread has ended.
    pub(super) ended: Receiver<Infallible>,
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
            keys: Down::default(),
            held: [false; Hold::COUNT],
            drag: None,
            dragged: false,
            cursor: PhysicalPosition::default(),
            cursor_inside: false,
            letters: Letters::default(),
            visible: true,
            picture: Picture::default(),
            compared: Compared::default(),
            split: 0.5,
            layer: None,
            status: None,
            loading: None,
            moving: true,
            asked: None,
            ui: Ui::default(),
            notice: String::new(),
            tried: None,
            clipboard: None,
            recorded_cursor: None,
            is_new_here: true,
            warned: None,
            title: String::new(),
            titled_at: None,
            presented: VecDeque::new(),
            latencies: VecDeque::new(),
            response: Response::default(),
            resizing: None,
            due: Due::default(),
            writers: Vec::new(),
        }
    }

    /// Waits for screenshots and, for a moment, for the engine.
    ///
    /// # Errors
    /// What ended the window, if it was not the user.
    pub fn finish(mut self) -> Result<Response, ViewError> {
        self.response = self.measured_response();
        for writer in std::mem::take(&mut self.writers) {
            // It said itself what it could not write.
            let _ = writer.join();
        }
        if let Some(engine) = self.engine.take() {
            let _ = engine.commands.send(Command::Quit);
            engine.interrupt.store(true, Ordering::SeqCst);
            // A scene that still loads cannot be interrupted, and has nothing to tidy up.
            if self.status.is_some() {
                let _: Result<Infallible, RecvTimeoutError> = engine.ended.recv_timeout(FAREWELL);
            }
        }
        self.failure.map_or(Ok(self.response), Err)
    }

    pub(super) fn fail(&mut self, event_loop: &ActiveEventLoop, error: ViewError) {
        self.failure.get_or_insert(error);
        event_loop.exit();
    }

    fn start_engine(&mut self) {
        let Some(open) = self.open.take() else { return };
        let (commands, receiver) = channel();
        let (alive, ended) = channel();
        let (presented, presented_receiver) = channel();
        let interrupt = Arc::new(AtomicBool::new(false));
        let name = &self.options.screenshot_stem;
        let loading = Some(format!("loading {name} …"));
        let published = Arc::new(Mutex::new(Published { loading, ..Published::default() }));
        let proxy = self.proxy.clone();
        let reference = self.options.reference.take();
        let engine = Engine {
            reference,
            scene: name.clone(),
            commands: receiver,
            own: commands.clone(),
            interrupt: Arc::clone(&interrupt),
            published: Arc::clone(&published),
            presented: self
                .screen
                .as_ref()
                .is_some_and(|screen| screen.software)
                .then_some(presented_receiver),
            // The event loop is gone: so is who would look.
            wake: move |wake| drop(proxy.send_event(wake)),
        };
        let thread = std::thread::Builder::new().name("engine".to_owned()).spawn(move || {
            let _alive: Sender<Infallible> = alive;
            engine.run(open);
        });
        match thread {
            Ok(_) => {
                self.engine = Some(Link { commands, interrupt, published, presented, ended });
            }
            Err(error) => drop(self.proxy.send_event(Wake::Crashed(error.to_string()))),
        }
    }

    pub(super) fn send(&self, command: Command) {
        if let Some(engine) = &self.engine {
            // An engine that has ended has said why by an event.
            let _ = engine.commands.send(command);
            engine.interrupt.store(true, Ordering::SeqCst);
        }
    }

    /// What is on the clipboard.
    pub(super) fn pasted(&mut self) -> Option<String> {
        if self.clipboard.is_none() {
            self.clipboard = arboard::Clipboard::new().ok();
        }
        self.clipboard.as_mut()?.get_text().ok()
    }

    /// Puts `text` on the clipboard, and says so after what was `said`.
    fn copy(&mut self, said: &str, text: String) {
        if self.clipboard.is_none() {
            self.clipboard = arboard::Clipboard::new().ok();
        }
        let copied =
            self.clipboard.as_mut().is_some_and(|clipboard| clipboard.set_text(text.clone()).is_ok());
        let is_short = said.is_empty();
        self.say(&match (copied, is_short) {
            (true, true) => format!("copied: {text}"),
            (false, true) => text,
            (true, false) => format!("{said}; the command that renders it is on the clipboard"),
            (false, false) => format!("{said}; the command that renders it is on standard output"),
        });
    }

    /// Shows `text` for a while, with keys in place of their names: see [`Keymap::fill`](super::keymap::Keymap::fill).
    pub(super) fn say(&mut self, text: &str) {
        self.notice = self.options.keys.fill(text, &self.letters);
        self.due.notice = Some(Instant::now() + NOTICE);
        self.redraw();
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
}

impl ApplicationHandler<Wake> for Viewer {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.screen.is_some() {
            return;
        }
        match Screen::open(event_loop, &self.options.title, self.options.size, self.options.in_points) {
            Ok(screen) => {
                let size = screen.size();
                self.screen = Some(screen);
                self.due.exit = self.options.exit_after.map(|time| Instant::now() + time);
                self.start_engine();
                self.send(Command::Resize(size));
                let notice = std::mem::take(&mut self.options.notice);
                if !notice.is_empty() {
                    self.say(&notice);
                }
                self.redraw();
            }
            Err(why) => self.fail(event_loop, ViewError::NoDisplay(why)),
        }
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, wake: Wake) {
        match wake {
            Wake::FrameReady => {
                self.take_published();
                if let Some(recorder) = &mut self.options.record {
                    recorder.begin();
                }
                self.redraw_in_time();
            }
            Wake::Notice(text) => self.say(&text),
            Wake::Copy { said, text } => self.copy(&said, text),
            Wake::NotOpened(why) => match self.tried.take() {
                // Whoever has mistyped a name shall not have to type it again.
                Some(tried) => {
                    self.ui.prompt = Some(tried.failed(&why));
                    self.redraw();
                }
                None => self.say(&why),
            },
            Wake::Opened { name, folder } => {
                self.tried = None;
                self.options.folder = folder;
                self.options.title = format!("Penumbra – {name}");
                self.options.screenshot_stem = name;
                self.redraw();
            }
            Wake::Plain(shot) => self.take_shot(&shot),
            Wake::OpenFailed(why) => self.fail(event_loop, ViewError::Scene(why)),
            Wake::Crashed(why) => self.fail(event_loop, ViewError::Lost(format!("internal error: {why}"))),
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => self.leave_program(event_loop),
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
            WindowEvent::DroppedFile(path) if self.may_lose_edits() => {
                self.record(&Event::Open(path.clone()));
                self.send(Command::Open(path));
            }
            WindowEvent::KeyboardInput { event, is_synthetic, .. } => {
                self.key(event_loop, &event, is_synthetic);
            }
            WindowEvent::MouseInput { state, button, .. } => {
                self.button(button, state == ElementState::Pressed);
            }
            WindowEvent::CursorMoved { position, .. } => self.cursor_moved(position),
            WindowEvent::CursorLeft { .. } => self.cursor_inside = false,
            WindowEvent::MouseWheel { delta, .. } => self.wheel(delta),
            _ => {}
        }
    }

    fn device_event(&mut self, _: &ActiveEventLoop, _: DeviceId, event: DeviceEvent) {
        if let DeviceEvent::MouseMotion { delta: (x, y) } = event {
            self.mouse_moved(DVec2::new(x, y));
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let now = Instant::now();
        self.replay(event_loop, now);
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
