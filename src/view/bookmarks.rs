//! Places that the user remembers, of each scene; and the file that keeps them until the next time.
//!
//! ```toml
//! [scene."/home/me/room.glb".3]  # the third of this scene
//! matrix = [[1, 0, 0, 0], [0, 1, 0, 2], [0, 0, 1, 5], [0, 0, 0, 1]]  # camera to scene, rows first
//! vertical_fov = 0.8             # radians; or orthographic_height, scene units
//! lens = [0.05, 4.0]             # radius and distance of what is sharp, if not all is
//! pivot = [0, 1, 0]              # what is orbited
//! ```

use super::controls::{Notice, Notices};
use super::flags::absolute;
use super::fly::{FlyCamera, FlyCameraState};
use super::input::Input;
use super::keymap::Tap;
use super::orbit::Navigation;
use crate::image::files::write_whole;
use crate::load::SceneSource;
use crate::load::settings::edit::rows_of;
use crate::open::SceneOrigin;
use crate::scene::{ActiveCamera, Camera, GlobalTransform, Lens, Projection, Transform};
use bevy_ecs::prelude::*;
use glam::{DAffine3, DMat4, DVec3, DVec4};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// How many a scene has.
const COUNT: usize = 9;

/// Places that the user remembers, of each scene that the window has shown, and of those before that a file has kept.
#[derive(Resource, Clone, Debug, Default)]
pub struct Bookmarks {
    of: HashMap<String, [Option<Bookmark>; COUNT]>,
    file: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Bookmark {
    camera: Camera,
    transform: Transform,
    lens: Option<Lens>,
    pivot: DVec3,
}

impl Bookmarks {
    /// Those of a file, which is made with the first that is set; and what is wrong with it.
    #[must_use]
    pub fn kept_in(file: PathBuf) -> (Self, Option<String>) {
        let (of, wrong) = match read(&file) {
            Ok(kept) => (kept.bookmarks(), None),
            Err(why) => (HashMap::new(), Some(why)),
        };
        (Self { of, file: Some(file) }, wrong)
    }

    fn set(&mut self, scene: &str, number: u8, bookmark: Bookmark) -> Result<(), String> {
        let own = self.of.entry(scene.to_owned()).or_default();
        own[usize::from(number) - 1] = Some(bookmark);
        let Some(file) = &self.file else { return Ok(()) };
        // Other windows set theirs.
        let mut kept = read(file)?;
        kept.scene.entry(scene.to_owned()).or_default().insert(number.to_string(), Kept::of(&bookmark));
        write(file, &kept)
    }
}

/// What the file has: by scene and number.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    scene: BTreeMap<String, BTreeMap<String, Kept>>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    matrix: [[f64; 4]; 4],
    #[serde(skip_serializing_if = "Option::is_none")]
    vertical_fov: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    orthographic_height: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lens: Option<[f32; 2]>,
    pivot: [f64; 3],
}

impl Kept {
    fn of(bookmark: &Bookmark) -> Self {
        let (vertical_fov, orthographic_height) = match bookmark.camera.projection {
            Projection::Perspective { vertical_fov } => (Some(vertical_fov), None),
            Projection::Orthographic { height } => (None, Some(height)),
        };
        Self {
            matrix: rows_of(&bookmark.transform),
            vertical_fov,
            orthographic_height,
            lens: bookmark.lens.map(|lens| [lens.radius, lens.focus]),
            pivot: bookmark.pivot.to_array(),
        }
    }

    /// Nothing, if it is no place to look from.
    fn bookmark(&self) -> Option<Bookmark> {
        let positive = |x: f32| x.is_finite() && x > 0.0;
        let projection = match (self.vertical_fov, self.orthographic_height) {
            (Some(vertical_fov), None) if positive(vertical_fov) && vertical_fov < std::f32::consts::PI => {
                Projection::Perspective { vertical_fov }
            }
            (None, Some(height)) if positive(height) => Projection::Orthographic { height },
            _ => return None,
        };
        let matrix = DMat4::from_cols_array_2d(&self.matrix).transpose();
        let turns = matrix.determinant();
        let is_place = matrix.is_finite() && matrix.row(3) == DVec4::W && turns.is_finite() && turns != 0.0;
        let pivot = DVec3::from(self.pivot);
        let lens_is_one = self.lens.is_none_or(|lens| lens.into_iter().all(positive));
        (is_place && pivot.is_finite() && lens_is_one).then(|| Bookmark {
            camera: Camera { projection },
            transform: Transform(DAffine3::from_mat4(matrix)),
            lens: self.lens.map(|[radius, focus]| Lens { radius, focus }),
            pivot,
        })
    }
}

impl File {
    fn bookmarks(&self) -> HashMap<String, [Option<Bookmark>; COUNT]> {
        let of = |numbers: &BTreeMap<String, Kept>| {
            std::array::from_fn(|n| numbers.get(&(n + 1).to_string()).and_then(Kept::bookmark))
        };
        self.scene.iter().map(|(scene, numbers)| (scene.clone(), of(numbers))).collect()
    }
}

/// Where they are kept: beside the user's keys.
#[must_use]
pub fn default_path() -> Option<PathBuf> {
    super::keys_file::default_path().map(|keys| keys.with_file_name("bookmarks.toml"))
}

/// What is not there yet is empty.
fn read(file: &Path) -> Result<File, String> {
    let told = |why: &str| format!("{}: {}", file.display(), why.trim().replace('\n', ", "));
    match std::fs::read_to_string(file) {
        Ok(text) => toml::from_str(&text).map_err(|error| told(error.message())),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(File::default()),
        Err(error) => Err(told(&error.to_string())),
    }
}

fn write(file: &Path, kept: &File) -> Result<(), String> {
    let told = |why: String| format!("{}: {why}", file.display());
    let text = toml::to_string(kept).map_err(|error| told(error.to_string()))?;
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder).map_err(|error| told(error.to_string()))?;
    }
    write_whole(file, text.as_bytes()).map_err(|error| error.to_string())
}

/// By what a scene is known: one that is opened again, by whatever path, is the same.
fn known_as(origin: Option<Res<SceneOrigin>>) -> String {
    origin.map_or_else(String::new, |origin| match &origin.source {
        SceneSource::File(path) => absolute(path),
        other => other.to_string(),
    })
}

/// Goes to a bookmark.
pub fn recall(
    input: Res<Input>,
    bookmarks: Res<Bookmarks>,
    origin: Option<Res<SceneOrigin>>,
    mut navigation: ResMut<Navigation>,
    mut cameras: Query<(Entity, &mut Camera, &mut Transform, &mut FlyCameraState), With<FlyCamera>>,
    mut commands: Commands,
    mut notices: ResMut<Notices>,
) {
    let own = bookmarks.of.get(&known_as(origin)).copied().unwrap_or_default();
    for press in &input.taps {
        let Tap::Recall(number) = press.tap else { continue };
        let Some(Some(bookmark)) = own.get(usize::from(number) - 1) else {
            notices
                .0
                .push(Notice::Text(format!("bookmark {number} is empty: {{set_bookmark_{number}}} sets it")));
            continue;
        };
        navigation.pivot = bookmark.pivot;
        for (entity, mut camera, mut transform, mut state) in &mut cameras {
            camera.set_if_neq(bookmark.camera);
            transform.set_if_neq(bookmark.transform);
            state.set_if_neq(FlyCameraState::of(bookmark.transform.0.matrix3));
            match bookmark.lens {
                Some(lens) => commands.entity(entity).insert(lens),
                None => commands.entity(entity).remove::<Lens>(),
            };
        }
    }
}

/// Sets a bookmark.
pub fn remember(
    input: Res<Input>,
    active: Res<ActiveCamera>,
    navigation: Res<Navigation>,
    cameras: Query<(&Camera, &GlobalTransform, Option<&Lens>)>,
    mut bookmarks: ResMut<Bookmarks>,
    origin: Option<Res<SceneOrigin>>,
    mut notices: ResMut<Notices>,
) {
    let scene = known_as(origin);
    for press in &input.taps {
        if let Tap::Remember(number) = press.tap
            && let Ok((&camera, pose, lens)) = cameras.get(active.0)
        {
            let (transform, pivot) = (Transform(pose.0), navigation.pivot);
            let bookmark = Bookmark { camera, transform, lens: lens.copied(), pivot };
            let said = match bookmarks.set(&scene, number, bookmark) {
                Ok(()) => format!("bookmark {number} set"),
                Err(why) => format!("bookmark {number} set until the window is closed ({why})"),
            };
            notices.0.push(Notice::Text(said));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn a_bookmark(x: f64) -> Bookmark {
        Bookmark {
            camera: Camera { projection: Projection::Perspective { vertical_fov: 0.7 } },
            transform: Transform(DAffine3::from_rotation_y(0.1) * DAffine3::from_translation(DVec3::X * x)),
            lens: Some(Lens { radius: 0.1, focus: 3.3 }),
            pivot: DVec3::new(0.1, 1e-9, -1e9),
        }
    }

    #[test]
    fn they_are_there_again_to_the_bit_whoever_else_sets_some() {
        let folder = std::env::temp_dir().join(format!("penumbra-bookmarks-{}", std::process::id()));
        let file = folder.join("new folder/bookmarks.toml");
        let (mut one, wrong) = Bookmarks::kept_in(file.clone());
        assert_eq!(wrong, None);
        let (mut other, _) = Bookmarks::kept_in(file.clone());
        let parallel = Bookmark {
            camera: Camera { projection: Projection::Orthographic { height: 2.5 } },
            lens: None,
            ..a_bookmark(7.0)
        };
        one.set("a \"quoted\" / room.glb", 3, a_bookmark(1.0)).unwrap();
        other.set("a \"quoted\" / room.glb", 9, parallel).unwrap();
        other.set("cornell", 1, a_bookmark(2.0)).unwrap();
        one.set("a \"quoted\" / room.glb", 3, a_bookmark(0.3)).unwrap();
        let (again, wrong) = Bookmarks::kept_in(file);
        assert_eq!(wrong, None);
        let room = again.of["a \"quoted\" / room.glb"];
        assert_eq!((room[2], room[8]), (Some(a_bookmark(0.3)), Some(parallel)));
        assert_eq!(room.iter().flatten().count(), 2);
        assert_eq!(again.of["cornell"][0], Some(a_bookmark(2.0)));
        let left: Vec<_> = std::fs::read_dir(folder.join("new folder")).unwrap().collect();
        assert_eq!(left.len(), 1, "no drafts: {left:?}");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_broken_file_is_told_of_and_left_alone_and_no_place_is_no_bookmark() {
        let folder = std::env::temp_dir().join(format!("penumbra-broken-bookmarks-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("bookmarks.toml");
        std::fs::write(&file, "[scene\n").unwrap();
        let (mut bookmarks, wrong) = Bookmarks::kept_in(file.clone());
        assert!(wrong.is_some_and(|why| why.contains("bookmarks.toml") && !why.contains('\n')));
        assert!(bookmarks.set("cornell", 1, a_bookmark(1.0)).unwrap_err().contains("bookmarks.toml"));
        assert_eq!(bookmarks.of["cornell"][0], Some(a_bookmark(1.0)), "as long as the window is open");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "[scene\n");
        let place = |change: fn(&mut Kept)| {
            let mut kept = Kept::of(&a_bookmark(1.0));
            change(&mut kept);
            kept.bookmark()
        };
        assert_eq!(place(|_| {}), Some(a_bookmark(1.0)));
        assert_eq!(place(|kept| kept.matrix[0][0] = f64::NAN), None);
        assert_eq!(place(|kept| kept.matrix[3][3] = 2.0), None);
        assert_eq!(place(|kept| kept.matrix[1] = [0.0; 4]), None);
        assert_eq!(place(|kept| kept.vertical_fov = Some(4.0)), None);
        assert_eq!(place(|kept| kept.orthographic_height = Some(1.0)), None);
        assert_eq!(place(|kept| kept.lens = Some([0.1, 0.0])), None);
        assert_eq!(place(|kept| kept.pivot[1] = f64::INFINITY), None);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
