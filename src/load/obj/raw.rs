//! An OBJ file as it is written: lists, faces, and the line each face stands on.

use super::lines::{POLYPAINT, Statement, unquoted};
use super::numbers::{NONE, bytes_of, numbers, resolve, shorten};
use super::parts::Names;
use crate::bvh::MOST_TRIANGLES;
use crate::load::error::LoadError;
use crate::load::report::{Kind, Sink};
use crate::scene::color::linear_from_srgb;
use glam::{DVec3, Vec2, Vec3};
use std::collections::{BTreeMap, HashMap};

/// What is so far from zero, and this many times as far as it is large, is counted from a place of its own: single precision
/// would dent it.
const FAR: f64 = 4096.0;
const FAR_FOR_ITS_SIZE: f64 = 16.0;
/// Different statements that are left out and named.
const MOST_SKIPPED: usize = 24;

/// One corner of a face: indices of position, texture coordinates and normal, or [`NONE`].
#[derive(Clone, Copy)]
pub(super) struct Corner {
    pub(super) position: u32,
    pub(super) uv: u32,
    pub(super) normal: u32,
}

/// One face as it stands in the file.
pub(super) struct Face {
    /// Its corners begin here in [`Raw::corners`] and end where the next face's begin.
    pub(super) first_corner: u32,
    pub(super) line: u32,
    pub(super) material: u16,
    /// Smoothing group; 0 is off.
    pub(super) group: u32,
}

/// What of a file is not in the picture.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Skipped {
    ShortFaces,
    Points,
    Lines,
    FreeForm,
    Attributes,
    Unknown(String),
}

/// An OBJ file as it is written.
#[derive(Default)]
pub(super) struct Raw {
    /// As in the file.
    pub(super) places: Vec<DVec3>,
    /// Counted from `origin`, once all is read.
    pub(super) positions: Vec<Vec3>,
    /// Where the file's zero is not near enough for single precision, a place amid what is seen.
    pub(super) origin: DVec3,
    /// Empty, or as long as `places`.
    pub(super) colors: Vec<Vec3>,
    /// What comments of `ZBrush` say of the vertices, in their order.
    painted: Vec<[u8; 3]>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    pub(super) corners: Vec<Corner>,
    pub(super) faces: Vec<Face>,
    /// Names that faces use; None for faces before the first `usemtl`.
    pub(super) materials: Vec<Option<String>>,
    pub(super) libraries: Vec<String>,
    /// What `o` says ...
    pub(super) objects: Names,
    /// ... and `g`.
    pub(super) groups: Names,
    /// By name the index in `materials`.
    slots: HashMap<Option<String>, u16>,
    /// Of the faces to come.
    material: Option<String>,
    slot: Option<u16>,
    pub(super) group: u32,
    /// What was left out, how often, and the line of the first.
    skipped: BTreeMap<Skipped, (usize, u32)>,
}

impl Raw {
    pub(super) fn read(&mut self, file: &str, statement: &Statement<'_>) -> Result<(), LoadError> {
        let broken = |problem: String| LoadError::broken(file, format!("line {}", statement.line), problem);
        match statement.keyword {
            "v" => self.read_position(statement.rest).map_err(broken)?,
            "vt" => {
                let ([u, v, _], count) = numbers::<3>(statement.rest).map_err(broken)?;
                if count == 0 {
                    return Err(broken("texture coordinate without numbers".to_owned()));
                }
                self.uvs.push(Vec2::new(u as f32, 1.0 - v as f32));
            }
            "vn" => match numbers::<3>(statement.rest).map_err(broken)? {
                (normal, 3) => self.normals.push(DVec3::from(normal).as_vec3()),
                (_, count) => {
                    return Err(broken(format!("normal of {count} numbers instead of 3")));
                }
            },
            "f" | "fo" => self.read_face(statement).map_err(broken)?,
            "usemtl" => {
                self.material = Some(unquoted(statement.rest).to_owned());
                self.slot = None;
            }
            "mtllib" => self.libraries.push(statement.rest.to_owned()),
            "s" => self.group = group_of(statement.rest),
            "o" => self.objects.begin(unquoted(statement.rest), self.faces.len()),
            "g" => self.groups.begin(statement.rest, self.faces.len()),
            "p" => self.skip(Skipped::Points, statement.line),
            "l" => self.skip(Skipped::Lines, statement.line),
            "vp" | "cstype" | "deg" | "bmat" | "step" | "curv" | "curv2" | "surf" | "parm" | "trim"
            | "hole" | "scrv" | "sp" | "end" | "con" => self.skip(Skipped::FreeForm, statement.line),
            "bevel" | "c_interp" | "d_interp" | "lod" | "mg" | "shadow_obj" | "trace_obj" | "ctech"
            | "stech" | "usemap" | "maplib" => self.skip(Skipped::Attributes, statement.line),
            POLYPAINT => self.painted.extend(bytes_of(statement.rest).map(|[_, r, g, b]| [r, g, b])),
            other => {
                // Some old programs shout.
                let lower = ["v", "vt", "vn", "f", "g", "o", "s", "usemtl", "mtllib"]
                    .into_iter()
                    .find(|known| known.eq_ignore_ascii_case(other));
                match lower {
                    Some(keyword) => return self.read(file, &Statement { keyword, ..*statement }),
                    None => self.skip(Skipped::Unknown(shorten(other)), statement.line),
                }
            }
        }
        Ok(())
    }

    fn read_position(&mut self, text: &str) -> Result<(), String> {
        let (values, count) = numbers::<7>(text)?;
        if count < 3 {
            return Err(format!("vertex of {count} coordinates instead of 3"));
        }
        self.places.push(DVec3::new(values[0], values[1], values[2]));
        // Six numbers end in a colour; of seven the last is its alpha or, if the fourth could be that alone, the fourth a weight.
        let first = if count == 7 && values[3] == 1.0 && values[6] != 1.0 { 4 } else { 3 };
        let color = (count >= 6).then(|| DVec3::from_slice(&values[first..first + 3]).as_vec3());
        if color.is_some() && self.colors.is_empty() {
            self.colors.resize(self.places.len() - 1, Vec3::ONE);
        }
        if color.is_some() || !self.colors.is_empty() {
            self.colors.push(color.unwrap_or(Vec3::ONE));
        }
        Ok(())
    }

    fn read_face(&mut self, statement: &Statement<'_>) -> Result<(), String> {
        let first = self.corners.len();
        for word in statement.rest.split_ascii_whitespace().take_while(|word| !word.starts_with('#')) {
            let mut parts = word.split('/');
            let mut index = |count: usize, what: &str| resolve(parts.next(), count, what);
            let position = index(self.places.len(), "vertex")?;
            let uv = index(self.uvs.len(), "texture coordinate (vt)")?;
            let normal = index(self.normals.len(), "normal (vn)")?;
            if position == NONE {
                return Err(format!("face corner `{}` without a vertex index", shorten(word)));
            }
            self.corners.push(Corner { position, uv, normal });
        }
        if self.corners.len() - first < 3 {
            self.corners.truncate(first);
            self.skip(Skipped::ShortFaces, statement.line);
            return Ok(());
        }
        let first_corner = u32::try_from(first).map_err(|_| "more than 2^32 face corners".to_owned())?;
        let material = match self.slot {
            Some(slot) => slot,
            None => self.current_slot()?,
        };
        self.faces.push(Face { first_corner, line: statement.line, material, group: self.group });
        Ok(())
    }

    fn current_slot(&mut self) -> Result<u16, String> {
        let slot = match self.slots.get(&self.material) {
            Some(&known) => known,
            None => {
                let new = u16::try_from(self.materials.len());
                let new = new.map_err(|_| "more than 65536 materials".to_owned())?;
                self.materials.push(self.material.clone());
                self.slots.insert(self.material.clone(), new);
                new
            }
        };
        self.slot = Some(slot);
        Ok(slot)
    }

    /// Finds the origin, and brings all places to single precision.
    pub(super) fn settle(&mut self, file: &str, sink: &mut Sink<'_>) {
        let seen = self.corners.iter().filter_map(|corner| self.places.get(corner.position as usize));
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for place in seen.filter(|place| place.is_finite() && place.abs().max_element() < 1e15) {
            (low, high) = (low.min(*place), high.max(*place));
        }
        let (middle, extent) = ((low + high) * 0.5, (high - low).max_element());
        if middle.is_finite() && middle.abs().max_element() > FAR.max(FAR_FOR_ITS_SIZE * extent) {
            // In steps, so that it stays when a little is changed.
            let step = if extent > 0.0 { extent.log2().ceil().exp2() } else { 1.0 };
            self.origin = (middle / step).round() * step;
            let [x, y, z] = self.origin.to_array();
            sink.decide(
                file,
                format!("far from zero: counted from {x}, {y}, {z}, for the sake of its last digits"),
            );
        }
        let places = std::mem::take(&mut self.places);
        self.positions = places.into_iter().map(|place| (place - self.origin).as_vec3()).collect();
    }

    /// Takes the colours that `ZBrush` writes in comments, if there is one for each vertex and no other.
    pub(super) fn take_paint(&mut self, file: &str, sink: &mut Sink<'_>) {
        let painted = std::mem::take(&mut self.painted);
        if painted.is_empty() || !self.colors.is_empty() {
            return;
        }
        if painted.len() != self.positions.len() {
            let what = format!(
                "colours of ZBrush (#MRGB) left out: {} of them for {} vertices",
                painted.len(),
                self.positions.len()
            );
            sink.ignored(file, "", what);
        } else if painted.iter().any(|color| *color != [255; 3]) {
            let unit = |color: [u8; 3]| Vec3::from(color.map(f32::from)) / 255.0;
            self.colors = painted.into_iter().map(unit).collect();
            sink.decide(file, "vertex colours are those of ZBrush's comments (#MRGB)");
        }
    }

    /// Brings colours to linear ones from 0 to 1: other programs write them as they are shown, some as bytes.
    pub(super) fn scale_colors(&mut self, file: &str, sink: &mut Sink<'_>) {
        let most = self.colors.iter().filter(|c| c.is_finite()).map(|c| c.max_element()).fold(0.0, f32::max);
        if most > 2.0 && most <= 255.0 {
            self.colors.iter_mut().for_each(|color| *color /= 255.0);
            sink.decide(file, "vertex colours go beyond 1: read as 0 to 255");
        }
        if !self.colors.is_empty() {
            sink.decide(file, "vertex colours are taken for sRGB");
        }
        for color in &mut self.colors {
            *color = color.map(|c| if (0.0..=1.0).contains(&c) { linear_from_srgb(c) } else { c });
        }
    }

    /// Bytes that this and the mesh made of it take, with what building a hierarchy over it does.
    pub(super) fn memory(&self) -> u64 {
        let lists =
            36 * self.places.len() + 12 * self.colors.len() + 15 * self.painted.len() + 8 * self.uvs.len();
        let here = lists + 12 * self.normals.len() + 12 * self.corners.len() + 16 * self.faces.len();
        (here + 60 * self.corners.len() + (14 + 80) * self.triangles()) as u64
    }

    /// How many the faces become.
    fn triangles(&self) -> usize {
        self.corners.len() - 2 * self.faces.len()
    }

    /// Corners of face `i`.
    pub(super) fn corners_of(&self, i: usize) -> &[Corner] {
        let start = self.faces[i].first_corner as usize;
        let end = self.faces.get(i + 1).map_or(self.corners.len(), |next| next.first_corner as usize);
        &self.corners[start..end]
    }

    /// Indices into a list that the file does not have at all mean nothing.
    fn forget_absent(&mut self, file: &str, sink: &mut Sink<'_>) {
        let (no_uvs, no_normals) = (self.uvs.is_empty(), self.normals.is_empty());
        let mut forgotten = 0;
        for corner in &mut self.corners {
            if no_uvs && corner.uv != NONE {
                corner.uv = NONE;
                forgotten += 1;
            }
            if no_normals && corner.normal != NONE {
                corner.normal = NONE;
                forgotten += 1;
            }
        }
        if forgotten > 0 {
            let what = "indices of normals or texture coordinates ignored: the file has none";
            sink.remark(Kind::Repaired, file, "", what.to_owned(), forgotten);
        }
    }

    /// Faces may stand before their vertices, so indices are checked at the end.
    pub(super) fn check(&mut self, file: &str, sink: &mut Sink<'_>) -> Result<(), LoadError> {
        self.forget_absent(file, sink);
        let triangles = self.triangles();
        if triangles > MOST_TRIANGLES {
            let problem = format!(
                "{triangles} triangles, more than the {MOST_TRIANGLES} that fit into one mesh: part the file"
            );
            return Err(LoadError::broken(file, "its faces", problem));
        }
        for (i, face) in self.faces.iter().enumerate() {
            for corner in self.corners_of(i) {
                let lists = [
                    (corner.position, self.positions.len(), "vertex"),
                    (corner.uv, self.uvs.len(), "texture coordinate (vt)"),
                    (corner.normal, self.normals.len(), "normal (vn)"),
                ];
                let position = self.positions.get(corner.position as usize);
                if position.is_some_and(|p| p.is_nan()) {
                    let problem =
                        format!("uses vertex {}, which is not a finite number", corner.position + 1);
                    return Err(LoadError::broken(file, format!("line {}", face.line), problem));
                }
                for (index, count, what) in lists {
                    if index != NONE && index as usize >= count {
                        let problem =
                            format!("index out of range: {what} {} of {count}", u64::from(index) + 1);
                        return Err(LoadError::broken(file, format!("line {}", face.line), problem));
                    }
                }
            }
        }
        Ok(())
    }

    pub(super) fn warn(&self, file: &str, sink: &mut Sink<'_>) {
        for (skipped, &(count, line)) in &self.skipped {
            let what = match skipped {
                Skipped::ShortFaces => "faces with fewer than three corners".to_owned(),
                Skipped::Points => "points (`p`) have no surface".to_owned(),
                Skipped::Lines => "lines (`l`) have no surface".to_owned(),
                Skipped::FreeForm => {
                    "statements of free-form curves and surfaces are not supported".to_owned()
                }
                Skipped::Attributes => "statements of display attributes are not supported".to_owned(),
                Skipped::Unknown(keyword) => format!("unknown statement `{keyword}`"),
            };
            sink.remark(Kind::Ignored, file, &format!("line {line}"), what, count);
        }
        if self.faces.is_empty() {
            sink.ignored(file, "", "no faces in it: nothing to see");
        }
    }

    fn skip(&mut self, what: Skipped, line: u32) {
        if self.skipped.len() < MOST_SKIPPED || self.skipped.contains_key(&what) {
            self.skipped.entry(what).or_insert((0, line)).0 += 1;
        }
    }
}

/// Number of a smoothing group; 0 is off.
fn group_of(text: &str) -> u32 {
    match text.split_ascii_whitespace().next() {
        Some("on") => 1,
        Some(word) => word.parse().unwrap_or(0),
        None => 0,
    }
}
