//! A window whose every state is known: where its camera is it says itself (C), and what it shows must be what
//! `render` makes of the flags that are expected.

use super::desktop::{Desktop, Program, desktop, difference, wait_for};
use glam::{DVec2, DVec3};
use image::RgbImage;
use image::imageops::crop_imm;
use std::path::PathBuf;

/// Of the window, pixels.
pub const SIZE: [u32; 2] = [320, 240];

/// A program in a window of [`SIZE`], without status lines.
pub struct Watched {
    pub program: Program,
    pub desktop: Desktop,
    said: PathBuf,
    scene: Vec<String>,
}

/// A camera, as C tells it.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    pub flags: Vec<String>,
    pub eye: DVec3,
    pub ahead: DVec3,
    pub up: DVec3,
    /// Vertical, degrees; `None` in parallel.
    pub angle: Option<f64>,
    /// Of what is seen in parallel.
    pub height: Option<f64>,
    /// Radius and distance of what is sharp.
    pub lens: Option<[f64; 2]>,
}

impl Camera {
    pub fn right(&self) -> DVec3 {
        self.ahead.cross(self.up)
    }

    fn of(line: &str) -> Self {
        let flags: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        let value = |flag: &str| {
            let at = flags.iter().position(|f| f == flag)?;
            Some(flags[at + 1].split(',').map(|n| n.parse::<f64>().unwrap()).collect::<Vec<f64>>())
        };
        let vector = |flag: &str| DVec3::from_slice(&value(flag).unwrap());
        let number = |flag: &str| value(flag).map(|numbers| numbers[0]);
        let eye = vector("--camera-position");
        Self {
            eye,
            ahead: (vector("--camera-focal-point") - eye).normalize(),
            up: vector("--camera-view-up"),
            angle: number("--camera-view-angle"),
            height: number("--camera-orthographic"),
            lens: number("--lens-radius").map(|radius| [radius, number("--focus-distance").unwrap()]),
            flags,
        }
    }
}

/// What most look at.
const SCENE: &[&str] = &["scene.toml", "--resolution", "320x240", "--spp", "4"];

/// A floor of 8 × 8 at height 0, a red box in the middle and a blue one to its right, under a lamp and a point.
pub const ROOM: &str = "[[model]]\nfile = 'floor.obj'\n[[model]]\nfile = 'red.obj'\n[[model]]\nfile = 'blue.obj'\n\
    [[light]]\nkind = 'parallelogram'\ncorner = [-1, 4, -1]\nedge_u = [2, 0, 0]\nedge_v = [0, 0, 2]\n\
    radiance = [12, 12, 12]\n[[light]]\nkind = 'point'\nposition = [2, 3, 3]\nintensity = [25, 25, 25]\n\
    [camera]\nposition = [0, 4, 6]\ntarget = [0, 0.2, 0]\nvertical_fov = 45\n[render]\nexposure = 0\n";

/// A box between two corners, as OBJ.
fn cuboid(material: &str, low: [f64; 3], high: [f64; 3]) -> String {
    let mut text = format!("mtllib room.mtl\nusemtl {material}\n");
    for corner in 0..8 {
        let at = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
        text += &format!("v {} {} {}\n", at(0), at(1), at(2));
    }
    text + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
}

impl Watched {
    /// [`ROOM`].
    pub fn room(test: &str) -> Option<Self> {
        Self::room_of(test, SCENE)
    }

    /// [`ROOM`], by these flags of `render`.
    pub fn room_of(test: &str, scene: &[&str]) -> Option<Self> {
        Self::of(test, scene, &[], |desktop| {
            desktop.write("scene.toml", ROOM);
            desktop.write(
                "floor.obj",
                "mtllib room.mtl\nusemtl grey\nv -4 0 -4\nv 4 0 -4\nv 4 0 4\nv -4 0 4\nf 1 4 3 2\n",
            );
            desktop.write("red.obj", &cuboid("red", [-0.6, 0.0, -0.6], [0.6, 1.0, 0.6]));
            desktop.write("blue.obj", &cuboid("blue", [1.2, 0.0, 0.2], [2.0, 0.7, 1.0]));
            let colors = [("grey", "0.8 0.8 0.8"), ("red", "0.8 0.1 0.1"), ("blue", "0.1 0.1 0.8")];
            let colors = colors.map(|(name, color)| format!("newmtl {name}\nKd {color}\n"));
            desktop.write("room.mtl", &colors.concat());
        })
    }

    /// `scene.toml`, once `write` has written it; `own` are flags of the window that are none of [`Self::shows`].
    pub fn scene(test: &str, own: &[&str], write: impl FnOnce(&Desktop)) -> Option<Self> {
        Self::of(test, SCENE, own, write)
    }

    pub fn of(test: &str, scene: &[&str], own: &[&str], write: impl FnOnce(&Desktop)) -> Option<Self> {
        let desktop = desktop(test)?;
        write(&desktop);
        let said = desktop.directory.join("said.txt");
        let own = [&["--no-kept-samples", "--no-smoothing"], own].concat();
        let mut program = desktop.start_saying(&[scene, &own[..]].concat(), &said);
        desktop.hide_status(&mut program);
        let scene = scene.iter().map(|&word| word.to_owned()).collect();
        Some(Self { program, desktop, said, scene })
    }

    /// One that is never done, just these flags.
    pub fn endless(test: &str, flags: &[&str]) -> Option<Self> {
        let desktop = desktop(test)?;
        let said = desktop.directory.join("said.txt");
        let program = desktop.start_saying(flags, &said);
        wait_for("the first picture", || desktop.title(&program).contains(" of ").then_some(()));
        let watched = Self { program, desktop, said, scene: Vec::new() };
        // Short, long, all, none.
        watched.keys(&["z", "z", "z"]);
        Some(watched)
    }

    /// Closes the window and opens another one on the same scene.
    pub fn again(mut self) -> Self {
        self.keys(&["ctrl+q"]);
        self.program.wait();
        let scene = self.scene.iter().map(String::as_str);
        let flags: Vec<&str> = scene.chain(["--no-kept-samples", "--no-smoothing"]).collect();
        self.program = self.desktop.start_saying(&flags, &self.said);
        self.desktop.hide_status(&mut self.program);
        self
    }

    /// Presses these keys, one after the other.
    pub fn keys(&self, keys: &[&str]) {
        self.desktop.xdotool([&["key"], keys].concat());
    }

    /// Puts the cursor to this pixel.
    pub fn cursor(&self, x: u32, y: u32) {
        let [x, y] = [x, y].map(|n| n.to_string());
        self.desktop.xdotool(["mousemove", "--window", &self.program.window, &x, &y]);
    }

    /// Drags the mouse with this button from the middle by so many pixels.
    pub fn drag(&self, button: &str, by: DVec2) {
        self.cursor(SIZE[0] / 2, SIZE[1] / 2);
        let [x, y] = by.to_array().map(|n| n.to_string());
        self.desktop.xdotool([
            "mousedown",
            button,
            "mousemove_relative",
            "--sync",
            "--",
            &x,
            &y,
            "mouseup",
            button,
        ]);
    }

    /// Holds `key` down until that is to be seen.
    pub fn hold(&self, key: &str) {
        let before = self.upper();
        self.desktop.xdotool(["keydown", key]);
        wait_for(&format!("{key} to move the picture"), || {
            (difference(&before, &self.upper()) > 0.05).then_some(())
        });
        self.desktop.xdotool(["keyup", key]);
    }

    /// All lines on standard output so far.
    pub fn said(&self) -> Vec<String> {
        let text = std::fs::read_to_string(&self.said).unwrap();
        // The last one may not be whole yet.
        text.split_inclusive('\n').filter(|line| line.ends_with('\n')).map(|l| l.trim().to_owned()).collect()
    }

    /// The line that `key` makes the program say.
    pub fn answer(&self, key: &str) -> String {
        let before = self.said().len();
        self.keys(&[key]);
        wait_for(&format!("an answer to {key}"), || self.said().get(before).cloned())
    }

    /// Where the camera is, after all that was pressed.
    pub fn camera(&self) -> Camera {
        Camera::of(&self.answer("c"))
    }

    /// What the window shows above its notices.
    pub fn upper(&self) -> RgbImage {
        upper(&self.desktop.shot(&self.program))
    }

    /// The same, once two looks see the same.
    pub fn settled(&self) -> RgbImage {
        let mut last = self.upper();
        wait_for("a picture that stays", || {
            let now = self.upper();
            let is_same = now == last;
            last = now;
            is_same.then(|| last.clone())
        })
    }

    /// What `render` makes of the scene with `flags`.
    pub fn rendered(&self, flags: &[&str]) -> RgbImage {
        let scene: Vec<&str> = self.scene.iter().map(String::as_str).collect();
        self.run(&[&["render"], &scene[..], flags].concat())
    }

    /// The picture that the program makes of `arguments`.
    pub fn run(&self, arguments: &[&str]) -> RgbImage {
        let folder = self.desktop.directory.join("rendered");
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("expected.png");
        let mut command = self.desktop.command(env!("CARGO_BIN_EXE_penumbra"));
        let status = command.args(arguments).arg("-q").arg("-o").arg(&file).status();
        assert!(status.unwrap().success(), "{arguments:?}");
        image::open(file).unwrap().to_rgb8()
    }

    /// Waits until the window shows what `render` makes of the scene with `flags`.
    pub fn shows(&self, what: &str, flags: &[&str]) -> RgbImage {
        let expected = self.rendered(flags);
        self.shows_picture(what, &expected);
        expected
    }

    /// Waits until the window shows `expected`, as far as notices let it be seen.
    pub fn shows_picture(&self, what: &str, expected: &RgbImage) {
        self.shows_upper(what, &upper(expected));
    }

    /// The same, if that is all that is known of it.
    pub fn shows_upper(&self, what: &str, expected: &RgbImage) {
        wait_for(what, || (difference(expected, &self.upper()) == 0.0).then_some(()));
    }

    /// The camera, once the window shows what is seen from there.
    pub fn seen(&self, what: &str) -> Camera {
        let camera = self.camera();
        let flags: Vec<&str> = camera.flags.iter().map(String::as_str).collect();
        self.shows(what, &flags);
        camera
    }
}

impl Desktop {
    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.directory.join(name), text).unwrap();
    }
}

/// The part in which no notice lies.
pub fn upper(picture: &RgbImage) -> RgbImage {
    crop_imm(picture, 0, 0, picture.width(), picture.height() * 13 / 24).to_image()
}

/// Whether these are the same but for rounding.
pub fn near(a: DVec3, b: DVec3) -> bool {
    a.distance(b) < 1e-6 * (1.0 + a.length())
}
