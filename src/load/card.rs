//! The report card of a file: what was found, mended, left out, approximated, decided; or why it is refused.

use super::report::{Found, Kind, LoadReport, Phase, Remark, harmless};
use super::{LoadError, LoadOptions, SceneSource, edited_scene, load};
use bevy_ecs::world::World;
use serde::Serialize;
use std::ffi::OsStr;
use std::fmt::Write;

/// How a file fared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It is shown as it says.
    Valid,
    /// It is shown; something in it was mended, left out or approximated.
    Repaired,
    /// It is not shown.
    Refused,
}

/// The report card of one file.
#[derive(Clone, Debug, Serialize)]
pub struct Card {
    /// As the caller named it.
    pub file: String,
    /// How it fared.
    pub verdict: Verdict,
    /// Why it is refused.
    pub error: Option<String>,
    /// Triangles of all instances; see [`LoadReport::triangles`].
    pub triangles: usize,
    /// What is in it.
    pub found: Found,
    /// Seconds of each phase of loading.
    pub seconds: Vec<(Phase, f64)>,
    /// What was damaged and mended.
    pub repaired: Vec<Remark>,
    /// What was left out.
    pub ignored: Vec<Remark>,
    /// What is only nearly as the file says.
    pub approximated: Vec<Remark>,
    /// What the program decided because the file is silent.
    pub decided: Vec<Remark>,
}

impl Card {
    /// Loads what `argument` names (a file or a built-in scene) and keeps only the card.
    #[must_use]
    pub fn check(argument: impl AsRef<OsStr>, options: &LoadOptions) -> Self {
        let loaded = SceneSource::parse(&argument).and_then(|source| {
            match edited_scene(&source).filter(|_| options.scene_settings.is_none()) {
                Some((scene, edits)) => {
                    let options = LoadOptions { scene_settings: Some(edits), ..options.clone() };
                    load(&mut World::new(), &scene, &options)
                }
                None => load(&mut World::new(), &source, options),
            }
        });
        Self::new(&argument.as_ref().to_string_lossy(), &loaded)
    }

    /// The card of a file that was loaded or refused.
    #[must_use]
    pub fn new(file: &str, loaded: &Result<LoadReport, LoadError>) -> Self {
        Self::from_parts(file, loaded.as_ref().ok(), loaded.as_ref().err())
    }

    /// The card of a file that was loaded.
    #[must_use]
    pub fn of(file: &str, report: &LoadReport) -> Self {
        Self::from_parts(file, Some(report), None)
    }

    fn from_parts(file: &str, report: Option<&LoadReport>, error: Option<&LoadError>) -> Self {
        let of = |kind| report.into_iter().flat_map(|report| report.of(kind)).cloned().collect();
        let [repaired, ignored, approximated, decided]: [Vec<Remark>; 4] =
            [Kind::Repaired, Kind::Ignored, Kind::Approximated, Kind::Decided].map(of);
        let is_whole = repaired.is_empty() && ignored.is_empty() && approximated.is_empty();
        Self {
            file: file.to_owned(),
            verdict: match report {
                None => Verdict::Refused,
                Some(_) if is_whole => Verdict::Valid,
                Some(_) => Verdict::Repaired,
            },
            error: error.map(ToString::to_string),
            triangles: report.map_or(0, |report| report.triangles),
            found: report.map_or_else(Found::default, |report| report.found.clone()),
            seconds: report.map_or_else(Vec::new, |report| report.seconds.clone()),
            repaired,
            ignored,
            approximated,
            decided,
        }
    }

    /// The card as text of several lines, without a line end at the end.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = match (self.verdict, &self.error) {
            (Verdict::Refused, Some(error)) => {
                return format!("{}: refused\n  error         {}", harmless(&self.file), harmless(error));
            }
            (Verdict::Valid, _) => format!("{}: valid", self.file),
            _ => format!("{}: loads, though not all of it as it is in the file", self.file),
        };
        let mut line = |head: &str, what: &str| {
            // Writing to a String cannot fail.
            let _ = write!(text, "\n  {head:<13} {}", harmless(what));
        };
        for format in &self.found.formats {
            line("format", format);
        }
        line("found", &self.found.text(self.triangles));
        let times: Vec<String> =
            self.seconds.iter().map(|(phase, seconds)| format!("{phase} {seconds:.3} s")).collect();
        line("time", &times.join(", "));
        let kinds = [
            ("repaired", &self.repaired),
            ("ignored", &self.ignored),
            ("approximated", &self.approximated),
            ("decided", &self.decided),
        ];
        for (head, remarks) in kinds {
            for remark in remarks {
                // The card is headed by the file's name.
                let said = remark.to_string();
                line(head, said.strip_prefix(&format!("{}: ", self.file)).unwrap_or(&said));
            }
        }
        text
    }
}

impl Found {
    fn text(&self, triangles: usize) -> String {
        let several = |count: usize, one: &str, many: &str| match count {
            0 => None,
            1 => Some(format!("1 {one}")),
            _ => Some(format!("{count} {many}")),
        };
        let parts = [
            Some(format!("{triangles} triangles")),
            several(self.vertices, "vertex", "vertices"),
            several(self.meshes, "mesh", "meshes"),
            several(self.instances, "instance", "instances"),
            several(self.materials, "material", "materials"),
            several(self.textures, "texture", "textures"),
            several(self.lights, "light", "lights"),
            several(self.cameras, "camera", "cameras"),
        ];
        let others = self.others.iter().map(|(what, count)| format!("{what}: {count}"));
        parts.into_iter().flatten().chain(others).collect::<Vec<_>>().join(", ")
    }
}
