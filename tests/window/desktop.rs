//! An X server of our own, and the program in it.

use image::RgbImage;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Whatever takes longer hangs.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// One at a time: tests that look at the clock shall not disturb each other.
static TURN: Mutex<()> = Mutex::new(());

/// An X server of our own, with a window manager if there is one.
pub struct Desktop {
    server: Child,
    pub manager: Option<Child>,
    display: String,
    pub directory: PathBuf,
    _turn: MutexGuard<'static, ()>,
}

/// The program in it.
pub struct Program {
    pub child: Child,
    pub window: String,
}

pub fn has_tool(name: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|directory| directory.join(name).is_file())
}

/// A desktop for `test`; `None`, and a line that says so, if the tools are missing and may be.
pub fn desktop(test: &str) -> Option<Desktop> {
    let missing: Vec<&str> =
        ["Xvfb", "xdotool", "import"].into_iter().filter(|tool| !has_tool(tool)).collect();
    if missing.is_empty() {
        return Some(Desktop::open(test));
    }
    let required = std::env::var_os("CI").is_some()
        || std::env::var_os("PENUMBRA_WINDOW_TESTS").is_some_and(|v| v == "required");
    assert!(!required, "{test}: {} must be installed", missing.join(", "));
    println!("SKIPPED {test}: not installed: {}", missing.join(", "));
    None
}

pub fn wait_for<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(start.elapsed() < PATIENCE, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

pub fn pause(milliseconds: u64) {
    std::thread::sleep(Duration::from_millis(milliseconds));
}

impl Desktop {
    pub fn open(test: &str) -> Self {
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let directory = std::env::temp_dir().join(format!("penumbra-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&directory).unwrap();
        // The server chooses a free display itself and says which.
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let display = format!(":{}", number.trim());
        let mut desktop = Self { server, manager: None, display, directory, _turn: turn };
        if has_tool("openbox") && has_tool("wmctrl") {
            // A window that is mapped before the manager is ready stays hidden.
            let ready = desktop.directory.join("ready");
            let manager = desktop
                .command("openbox")
                .args(["--startup", &format!("touch {}", ready.display())])
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn();
            desktop.manager = Some(manager.unwrap());
            wait_for("the window manager", || ready.exists().then_some(()));
            pause(100);
        }
        desktop
    }

    pub fn command(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new(program);
        command
            .env("DISPLAY", &self.display)
            .env("XDG_RUNTIME_DIR", &self.directory)
            .env("XDG_CONFIG_HOME", &self.directory)
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .current_dir(&self.directory)
            .stdin(Stdio::null());
        command
    }

    pub fn xdotool<'a>(&self, arguments: impl IntoIterator<Item = &'a str>) -> String {
        let output = self.command("xdotool").args(arguments).output().unwrap();
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    }

    /// Starts the program and gives it the keyboard.
    pub fn start(&self, arguments: &[&str]) -> Program {
        self.start_with(arguments, &[])
    }

    pub fn start_with(&self, arguments: &[&str], environment: &[(&str, &str)]) -> Program {
        self.start_command(
            self.command(env!("CARGO_BIN_EXE_penumbra"))
                .args(arguments)
                .envs(environment.iter().copied())
                .stdout(Stdio::null()),
        )
    }

    /// What it says on standard output goes to `file`.
    pub fn start_saying(&self, arguments: &[&str], file: &Path) -> Program {
        let said = std::fs::File::create(file).unwrap();
        self.start_command(self.command(env!("CARGO_BIN_EXE_penumbra")).args(arguments).stdout(said))
    }

    pub fn start_command(&self, command: &mut Command) -> Program {
        let child = command.spawn().unwrap();
        let mut program = Program { child, window: String::new() };
        program.window = wait_for("the window", || {
            assert!(program.child.try_wait().unwrap().is_none(), "the program ended at once");
            let found = self.xdotool(["search", "--onlyvisible", "--class", "^penumbra$"]);
            found.lines().next().map(str::to_owned)
        });
        self.focus(&program);
        program
    }

    pub fn focus(&self, program: &Program) {
        let verb = if self.manager.is_some() { "windowactivate" } else { "windowfocus" };
        self.xdotool([verb, &program.window]);
        wait_for("the focus", || (self.xdotool(["getwindowfocus"]) == program.window).then_some(()));
    }

    pub fn title(&self, program: &Program) -> String {
        self.xdotool(["getwindowname", &program.window])
    }

    /// Waits until all samples are there.
    pub fn wait_until_done(&self, program: &mut Program) {
        wait_for("the sample target", || {
            assert!(program.child.try_wait().unwrap().is_none(), "the program ended");
            self.title(program).ends_with("- done").then_some(())
        });
        // The last picture is on its way.
        pause(300);
    }

    /// What the inside of the window shows.
    pub fn shot(&self, program: &Program) -> RgbImage {
        let output = self
            .command("import")
            .args(["-window", &program.window, "-depth", "8", "png:-"])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        image::load_from_memory(&output.stdout).unwrap().to_rgb8()
    }

    pub fn size(&self, program: &Program) -> (u32, u32) {
        let geometry = self.xdotool(["getwindowgeometry", "--shell", &program.window]);
        let value = |name: &str| {
            let line = geometry.lines().find_map(|line| line.strip_prefix(name));
            line.unwrap_or_else(|| panic!("no {name} in {geometry}")).parse().unwrap()
        };
        (value("WIDTH="), value("HEIGHT="))
    }

    /// Waits until nothing but the picture is seen: no notice, no status lines.
    pub fn hide_status(&self, program: &mut Program) {
        // Short, long, all, none.
        self.xdotool(["key", "z", "key", "z", "key", "z"]);
        self.wait_until_done(program);
    }
}

impl Drop for Desktop {
    fn drop(&mut self) {
        for child in self.manager.iter_mut().chain([&mut self.server]) {
            let _ = child.kill();
            let _ = child.wait();
        }
        let _ = std::fs::remove_dir_all(&self.directory);
    }
}

impl Program {
    pub fn wait(&mut self) -> ExitStatus {
        wait_for("the end of the program", || self.child.try_wait().unwrap())
    }

    pub fn is_alive(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// CPU time of all threads, in clock ticks of 10 ms.
    pub fn ticks(&self) -> u64 {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id())).unwrap();
        // The name in parentheses may hold anything; `utime` is the twelfth field after it.
        let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
        fields[11].parse::<u64>().unwrap() + fields[12].parse::<u64>().unwrap()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub fn colors(picture: &RgbImage) -> usize {
    picture.pixels().collect::<std::collections::HashSet<_>>().len()
}

/// Share of the pixels that differ.
pub fn difference(a: &RgbImage, b: &RgbImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let differing = a.pixels().zip(b.pixels()).filter(|(a, b)| a != b).count();
    differing as f64 / f64::from(a.width() * a.height())
}

pub const SMALL: &[&str] = &["--resolution", "320x240", "--spp", "4"];

/// In the order of their numbers (up to nine).
pub fn pictures_in(directory: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|e| e == "png")).collect();
    files.sort();
    files
}

/// Pixels in which green is far above red and blue, and those in which red is above both.
pub fn green_and_red(picture: &RgbImage) -> (usize, usize) {
    let above = |a: u8, b: u8, c: u8| i32::from(a) > i32::from(b.max(c)) + 60;
    let green = picture.pixels().filter(|p| above(p[1], p[0], p[2])).count();
    let red = picture.pixels().filter(|p| above(p[0], p[1], p[2])).count();
    (green, red)
}
