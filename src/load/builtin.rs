//! Scenes that are compiled into the program.

use super::error::LoadError;

/// A scene that needs no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuiltIn {
    /// What to call it by.
    pub name: &'static str,
    /// What it shows, in one line.
    pub description: &'static str,
    /// Its asset.
    pub(super) file: &'static str,
}

/// The built-in scenes, the default one first.
#[must_use]
pub fn built_in_scenes() -> &'static [BuiltIn] {
    const fn scene(name: &'static str, file: &'static str, description: &'static str) -> BuiltIn {
        BuiltIn { name, description, file }
    }
    &[
        const { scene("cornell", "cornell.toml", "the Cornell box under its area light") },
        const { scene("cornell-point", "cornell-point.toml", "the same room under a point light: hard shadows") },
        const { scene("cornell-gltf", "cornell.gltf", "the same room as glTF, lit by an emissive mesh") },
        const { scene("gallery", "gallery.toml", "every shape of light, each in its own bay with its shadow") },
        const { scene("bust", "bust.toml", "a smooth owl's head of 968 triangles under a large light") },
        const { scene("checker", "checker.toml", "one texture twice: nearest beside bilinear") },
        const { scene("mirrors", "mirrors.toml", "mirrors, metal, gloss and glass") },
    ]
}

/// Contents of the asset `name`.
pub(super) fn asset(name: &str) -> Option<&'static [u8]> {
    macro_rules! assets {
        ($($file:literal),* $(,)?) => {
            match name {
                $($file => Some(include_bytes!(concat!("../../assets/", $file)).as_slice()),)*
                _ => None,
            }
        };
    }
    assets!(
        "bust.mtl",
        "bust.obj",
        "bust.toml",
        "checker.png",
        "checker.toml",
        "cornell.gltf",
        "cornell.mtl",
        "cornell.obj",
        "cornell.toml",
        "cornell-point.toml",
        "gallery.mtl",
        "gallery.obj",
        "gallery.toml",
        "mirrors.toml",
        "plane.obj",
        "sphere.obj",
    )
}

/// The scene of that name.
pub(super) fn find(name: &str) -> Option<&'static BuiltIn> {
    built_in_scenes().iter().find(|scene| scene.name == name)
}

/// The error for a name that is neither file nor scene.
pub(super) fn unknown(argument: &str) -> LoadError {
    let names: Vec<&str> = built_in_scenes().iter().map(|scene| scene.name).collect();
    let nearest = names.iter().map(|name| (edits(argument, name), name)).min();
    let hint = match nearest {
        Some((distance, name)) if distance <= 3 => format!("; did you mean `{name}`?"),
        _ => String::new(),
    };
    LoadError::UnknownScene { argument: argument.to_owned(), hint, names: names.join(", ") }
}

/// Letters to insert, remove or change to get from one word to the other (Levenshtein).
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, a) in a.chars().take(100).enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, &b) in b.iter().enumerate() {
            let changed = diagonal + usize::from(a != b);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
