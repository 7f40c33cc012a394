//! Why a scene cannot be shown: one line, naming the file, the place in it and the way out.

use std::fmt::Display;
use thiserror::Error;

/// Why [`super::load`] gave up.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The scene's own file cannot be read.
    #[error("{file}: {source}")]
    Read {
        /// As the caller named it.
        file: String,
        /// What is wrong with it.
        source: ReadError,
    },
    /// Neither a file nor a built-in scene.
    #[error("{argument}: no such file, and no built-in scene of that name{hint}; built-in scenes: {names}")]
    UnknownScene {
        /// What was asked for.
        argument: String,
        /// `; did you mean ...?` or nothing.
        hint: String,
        /// All built-in scenes.
        names: String,
    },
    /// A folder with no scene in it, or with several.
    #[error("{folder}: is a folder; {names}")]
    Folder {
        /// The folder.
        folder: String,
        /// What is in it.
        names: String,
    },
    /// The ending says nothing, nor do the first bytes.
    #[error("{file}: cannot tell its format; Penumbra reads .gltf, .glb, .obj and .toml")]
    UnknownFormat {
        /// The file.
        file: String,
    },
    /// A required glTF extension is not supported.
    #[error("{file}: needs {extension}, which Penumbra cannot read; {way_out}")]
    Extension {
        /// The file.
        file: String,
        /// Its name, e.g. `KHR_draco_mesh_compression`.
        extension: String,
        /// What the user can do.
        way_out: &'static str,
    },
    /// The user chose a scene, animation or variant that the file does not have.
    #[error("{file}: no {kind} \"{wanted}\"; it has {names}")]
    NotThere {
        /// The file.
        file: String,
        /// Scene, animation or variant.
        kind: &'static str,
        /// What was asked for.
        wanted: String,
        /// What there is.
        names: String,
    },
    /// It would take more memory than loading may.
    #[error(
        "{file}: {place}: takes loading to {needed} MiB of memory, more than the {limit} MiB allowed; allow more with --max-memory"
    )]
    Memory {
        /// The file.
        file: String,
        /// What of it.
        place: String,
        /// MiB that loading would have taken.
        needed: u64,
        /// MiB that it may take.
        limit: u64,
    },
    /// The content is damaged or contradicts itself.
    #[error("{file}: {place}: {problem}")]
    Broken {
        /// The file.
        file: String,
        /// Line, node, accessor, mesh ...
        place: String,
        /// What is wrong there, and what to do if that is known.
        problem: String,
    },
}

/// Why a file cannot be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReadError {
    /// It is not there.
    #[error("no such file")]
    Missing,
    /// A directory, pipe or device.
    #[error("is not a regular file")]
    NotAFile,
    /// Longer than its kind may be.
    #[error("is {length} bytes long; Penumbra reads at most {limit} of such a file")]
    TooLarge {
        /// Bytes it has.
        length: u64,
        /// Bytes it may have.
        limit: u64,
    },
    /// The reference leaves the folder of the scene.
    #[error("lies outside the scene's folder and is not opened; put the file beside the scene")]
    Outside,
    /// The reference is a URL.
    #[error("is a URI with the scheme `{0}`, which is not opened; put the file beside the scene")]
    Scheme(String),
    /// The operating system says no.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// A `data:` URI that cannot be decoded.
    #[error("{0}")]
    Data(&'static str),
}

impl LoadError {
    /// [`LoadError::Broken`] from anything printable.
    pub(super) fn broken(file: &str, place: impl Display, problem: impl Display) -> Self {
        Self::Broken { file: file.to_owned(), place: place.to_string(), problem: problem.to_string() }
    }
}

/// `names` with their numbers, as the user may choose them; `none` if there are none.
pub(crate) fn choices<'a>(names: impl IntoIterator<Item = &'a str>, none: &str) -> String {
    let names: Vec<String> =
        names.into_iter().enumerate().map(|(i, name)| format!("{i} \"{name}\"")).collect();
    if names.is_empty() { none.to_owned() } else { names.join(", ") }
}
