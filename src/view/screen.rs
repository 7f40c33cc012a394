//! The window and the surface that its pixels are presented on.

use super::exchange::{lock, panic_message};
use super::without_place;
use glam::UVec2;
use pixels::wgpu::{DeviceType, PresentMode, SurfaceError, TextureFormat};
use pixels::{Error, Pixels, PixelsBuilder, SurfaceTexture};
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use winit::dpi::{LogicalSize, PhysicalSize, Size};
use winit::event_loop::ActiveEventLoop;
use winit::window::{Fullscreen, Window};

/// After so many failures in a row the surface is asked less often.
const PATIENCE: u32 = 20;

/// What became of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Presented {
    /// It is on its way to the screen.
    Yes,
    /// Not now; try again after this time.
    Later(Duration),
    /// Never again.
    Lost(String),
}

/// A window that shows bytes.
pub struct Screen {
    // Before the window: the surface goes first.
    pixels: Pixels<'static>,
    /// The window.
    pub window: Arc<Window>,
    /// Whether the "GPU" is this machine's CPU, so that presenting takes time from tracing.
    pub software: bool,
    size: UVec2,
    failures: u32,
    device_error: Arc<Mutex<Option<String>>>,
}

impl Screen {
    /// Opens a window with `size` physical pixels inside, or as many points of the display, if the desktop allows.
    pub fn open(
        event_loop: &ActiveEventLoop,
        title: &str,
        size: UVec2,
        in_points: bool,
    ) -> Result<Self, String> {
        let [width, height] = size.max(UVec2::ONE).to_array();
        let inside: Size = match in_points {
            true => {
                let fits = fitting(event_loop, [width, height].map(f64::from));
                LogicalSize::new(f64::from(width) * fits, f64::from(height) * fits).into()
            }
            false => PhysicalSize::new(width, height).into(),
        };
        let attributes = Window::default_attributes().with_title(title).with_inner_size(inside);
        #[cfg(target_os = "linux")]
        let attributes =
            winit::platform::x11::WindowAttributesExtX11::with_name(attributes, "penumbra", "penumbra");
        let window = event_loop
            .create_window(attributes)
            .map_err(|e| format!("cannot open a window: {}", without_place(&e.to_string())))?;
        let window = Arc::new(window);
        let size = vector(window.inner_size()).max(UVec2::ONE);
        let mut pixels = build(&window, size, |builder| builder)?;
        let software = pixels.adapter().get_info().device_type == DeviceType::Cpu;
        if software && let Some(format) = plain_format(&pixels) {
            // One surface for each window.
            drop(pixels);
            let plain = build(&window, size, |builder| {
                builder
                    .texture_format(TextureFormat::Rgba8Unorm)
                    .surface_texture_format(format)
                    .present_mode(PresentMode::Mailbox)
            });
            pixels = plain.or_else(|_| build(&window, size, |builder| builder))?;
        }
        let device_error = Arc::new(Mutex::new(None));
        let seen = Arc::clone(&device_error);
        // wgpu's own handler panics, for instance when another program destroys the window.
        pixels.device().on_uncaptured_error(Arc::new(move |error: pixels::wgpu::Error| {
            lock(&seen).get_or_insert_with(|| error.to_string());
        }));
        Ok(Self { pixels, window, software, size, failures: 0, device_error })
    }

    /// Width and height of the picture on it, physical pixels, at least 1.
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// Follows the window, whose inside is now `size` pixels, each side above 0.
    pub fn resize(&mut self, size: UVec2) {
        let limit = self.pixels.device().limits().max_texture_dimension_2d;
        let size = size.clamp(UVec2::ONE, UVec2::splat(limit));
        if size != self.size
            && self.pixels.resize_surface(size.x, size.y).is_ok()
            && self.pixels.resize_buffer(size.x, size.y).is_ok()
        {
            self.size = size;
        }
    }

    /// Lets `paint` write sRGB bytes of [`Screen::size`] pixels, and shows them.
    pub fn draw(&mut self, paint: impl FnOnce(&mut [u8], UVec2)) -> Presented {
        paint(self.pixels.frame_mut(), self.size);
        if !self.software {
            // It makes the next picture wait for the display, and the engine for that picture.
            self.window.pre_present_notify();
        }
        let outcome = self.pixels.render();
        let device_error = lock(&self.device_error).take();
        became(outcome, device_error, &mut self.failures)
    }

    /// The bytes drawn last.
    pub fn bytes(&self) -> &[u8] {
        self.pixels.frame()
    }

    /// Full screen or window.
    pub fn toggle_full_screen(&self) {
        let full = self.window.fullscreen().is_none().then_some(Fullscreen::Borderless(None));
        self.window.set_fullscreen(full);
    }
}

type Builder = PixelsBuilder<'static, 'static, 'static, Arc<Window>>;

/// What draws into the window, as `set` has it.
fn build(
    window: &Arc<Window>,
    size: UVec2,
    set: impl FnOnce(Builder) -> Builder,
) -> Result<Pixels<'static>, String> {
    let surface = SurfaceTexture::new(size.x, size.y, Arc::clone(window));
    // wgpu panics if WGPU_ADAPTER_NAME matches nothing.
    quietly(|| set(PixelsBuilder::new(size.x, size.y, surface)).build())
        .map_err(|panic| format!("no graphics adapter: {panic}"))?
        .map_err(|e| {
            format!("no graphics adapter (Vulkan or GL) can draw into the window: {}", with_sources(&e))
        })
}

/// A format of the surface that takes our bytes as they are: an adapter on the CPU is not to make light of
/// them and bytes again.
fn plain_format(pixels: &Pixels<'_>) -> Option<TextureFormat> {
    let formats = &pixels.context().surface_capabilities.formats;
    [TextureFormat::Bgra8Unorm, TextureFormat::Rgba8Unorm].into_iter().find(|format| formats.contains(format))
}

/// What became of a picture, given what the surface and the device say, after so many failures in a row.
fn became(outcome: Result<(), Error>, device_error: Option<String>, failures: &mut u32) -> Presented {
    match (outcome, device_error) {
        (Ok(()), None) => {
            *failures = 0;
            Presented::Yes
        }
        (Err(Error::Surface(SurfaceError::OutOfMemory)), _) => {
            Presented::Lost("no graphics memory is left".into())
        }
        (Ok(()), Some(error)) if *failures > 2 * PATIENCE => Presented::Lost(error),
        (Ok(()) | Err(Error::Surface(_)), _) => {
            *failures += 1;
            Presented::Later(Duration::from_millis(if *failures > PATIENCE { 50 } else { 4 }))
        }
        (Err(error), _) => Presented::Lost(with_sources(&error)),
    }
}

/// As a vector.
pub fn vector(size: PhysicalSize<u32>) -> UVec2 {
    UVec2::new(size.width, size.height)
}

/// An error with all its causes.
fn with_sources(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text += &format!(": {cause}");
        source = cause.source();
    }
    text
}

/// Runs `f`; a panic on this thread becomes an error with its message, and prints nothing.
pub fn quietly<T>(f: impl FnOnce() -> T) -> Result<T, String> {
    let here = std::thread::current().id();
    let loud = Arc::new(take_hook());
    let others = Arc::clone(&loud);
    set_hook(Box::new(move |info| {
        if std::thread::current().id() != here {
            others(info);
        }
    }));
    let outcome = catch_unwind(AssertUnwindSafe(f));
    set_hook(Box::new(move |info| loud(info)));
    outcome.map_err(|panic| panic_message(&*panic))
}

/// Of the screen, what a window may take at most: there are borders and bars.
const ROOM: f64 = 0.9;

/// What a window of so many points is to be scaled by to fit the screen; 1 if it does, or nobody knows.
fn fitting(event_loop: &ActiveEventLoop, points: [f64; 2]) -> f64 {
    let monitor = event_loop.primary_monitor().or_else(|| event_loop.available_monitors().next());
    let Some(monitor) = monitor else { return 1.0 };
    let screen = monitor.size().to_logical::<f64>(monitor.scale_factor());
    share_of(points, [screen.width, screen.height])
}

/// The same for a screen of so many points.
fn share_of(points: [f64; 2], screen: [f64; 2]) -> f64 {
    let shares = [0, 1].map(|axis| ROOM * screen[axis] / points[axis]);
    // Of no size at all it is none.
    shares.into_iter().filter(|share| *share > 0.0).fold(1.0, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_surface_is_asked_again_ever_more_rarely_and_is_as_good_as_new_when_it_is_back() {
        let pause = |ms| Presented::Later(Duration::from_millis(ms));
        for error in [SurfaceError::Lost, SurfaceError::Outdated, SurfaceError::Timeout, SurfaceError::Other]
        {
            let mut failures = 0;
            for i in 0..500 {
                let said = became(Err(Error::Surface(error.clone())), None, &mut failures);
                assert_eq!(said, pause(if i < PATIENCE { 4 } else { 50 }), "{error:?} number {i}");
            }
            assert_eq!(became(Ok(()), None, &mut failures), Presented::Yes);
            assert_eq!(became(Err(Error::Surface(error)), None, &mut failures), pause(4));
        }
    }

    #[test]
    fn what_will_not_come_back_ends_the_window_with_its_reason() {
        let mut failures = 0;
        let full = became(Err(Error::Surface(SurfaceError::OutOfMemory)), None, &mut failures);
        assert_eq!(full, Presented::Lost("no graphics memory is left".to_owned()));
        // A device that complains may come to itself, but not for ever.
        let mut said = Presented::Yes;
        for _ in 0..2 * PATIENCE + 2 {
            said = became(Ok(()), Some("gone".to_owned()), &mut failures);
        }
        assert_eq!(said, Presented::Lost("gone".to_owned()));
        assert!(matches!(became(Err(Error::AdapterNotFound), None, &mut 0), Presented::Lost(_)));
    }

    #[test]
    fn a_window_is_no_larger_than_the_screen() {
        assert_eq!(share_of([960.0, 540.0], [1400.0, 1000.0]), 1.0);
        let fits = share_of([960.0, 540.0], [466.0, 333.0]);
        assert!((960.0 * fits - 0.9 * 466.0).abs() < 1e-9, "{fits}");
        assert_eq!(share_of([960.0, 540.0], [0.0, 0.0]), 1.0, "nobody knows");
    }

    #[test]
    fn a_quiet_panic_is_its_message() {
        assert_eq!(quietly(|| 3), Ok(3));
        assert_eq!(quietly(|| -> u8 { panic!("no {}", "library") }), Err("no library".to_owned()));
    }
}
