//! JSON → the tree of a file.

use super::animation::AnimationJson;
use crate::load::budget::Budget;
use crate::load::error::LoadError;
use crate::load::report::Sink;
use gltf::json::Root;
use rayon::prelude::*;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::borrow::Cow;

/// Bytes that an object within another takes: maps have room for eleven members.
pub(super) const OBJECT_MEMORY: u64 = 600;
/// Bytes that a value takes: of those that are kept as they are.
pub(super) const VALUE_MEMORY: u64 = 32;

/// About how many objects and values there are in the text.
pub(super) fn objects_and_values(json: &[u8]) -> [u64; 2] {
    let count =
        |wanted: u8| json.par_iter().with_min_len(1 << 16).filter(|&&byte| byte == wanted).count() as u64;
    [count(b'{'), count(b',')]
}

/// What is read a second time: where nodes stand, in double precision (`gltf::json` keeps only single),
/// what morph targets move, and animations.
#[derive(Deserialize)]
pub(super) struct More {
    #[serde(default)]
    pub(super) nodes: Vec<Placement>,
    #[serde(default)]
    pub(super) meshes: Vec<MeshMore>,
    #[serde(default)]
    pub(super) animations: Lenient<Vec<Lenient<AnimationJson>>>,
}

/// What `gltf::json` does not keep of a mesh.
#[derive(Deserialize)]
pub(super) struct MeshMore {
    #[serde(default)]
    primitives: Vec<PrimitiveMore>,
}

#[derive(Deserialize)]
struct PrimitiveMore {
    targets: Option<Vec<TargetMore>>,
}

#[derive(Deserialize)]
struct TargetMore {
    #[serde(rename = "COLOR_0")]
    color: Option<IgnoredAny>,
    #[serde(rename = "TEXCOORD_0")]
    uvs: Option<IgnoredAny>,
    #[serde(rename = "TANGENT")]
    tangents: Option<IgnoredAny>,
}

impl MeshMore {
    /// Whether morph targets of a primitive move more than places and directions.
    pub(super) fn moves_more(&self, primitive: usize) -> bool {
        self.targets(primitive).any(|target| target.color.is_some() || target.uvs.is_some())
    }

    /// Whether morph targets of a primitive say where its tangents turn.
    pub(super) fn turns_tangents(&self, primitive: usize) -> bool {
        self.targets(primitive).any(|target| target.tangents.is_some())
    }

    fn targets(&self, primitive: usize) -> impl Iterator<Item = &TargetMore> {
        let targets = self.primitives.get(primitive).and_then(|primitive| primitive.targets.as_ref());
        targets.into_iter().flatten()
    }
}

/// What may be damaged without harm to the rest.
#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum Lenient<T> {
    /// As the format says.
    Good(T),
    /// Something else.
    Bad(IgnoredAny),
}

impl<T: Default> Default for Lenient<T> {
    fn default() -> Self {
        Self::Good(T::default())
    }
}

impl<T> Lenient<T> {
    pub(super) fn good(&self) -> Option<&T> {
        match self {
            Self::Good(value) => Some(value),
            Self::Bad(_) => None,
        }
    }
}

/// A number of something, also if it is written as `4.0`.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "f64")]
pub(super) struct Whole(pub(super) u32);

impl TryFrom<f64> for Whole {
    type Error = &'static str;

    fn try_from(number: f64) -> Result<Self, Self::Error> {
        let whole = number as u32;
        if f64::from(whole) == number { Ok(Self(whole)) } else { Err("not a number of something") }
    }
}

/// Placement of one node; see the glTF specification, section 3.5.3.
#[derive(Default, Deserialize)]
pub(super) struct Placement {
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
}

/// Text that is not UTF-8 is a mix: what is none of it stands for Latin-1, as some exporters write names.
pub(super) fn as_utf8<'a>(
    file: &str,
    json: &'a [u8],
    sink: &mut Sink<'_>,
) -> Result<Cow<'a, [u8]>, LoadError> {
    if std::str::from_utf8(json).is_ok() {
        return Ok(Cow::Borrowed(json));
    }
    sink.budget.take(2 * json.len() as u64, file, "JSON")?;
    let mut text = String::with_capacity(json.len() + json.len() / 8);
    let mut odd = 0;
    for chunk in json.utf8_chunks() {
        text.push_str(chunk.valid());
        text.extend(chunk.invalid().iter().map(|&byte| char::from(byte)));
        odd += chunk.invalid().len();
    }
    let what = format!("bytes of its JSON are not UTF-8: taken for Latin-1, so a name may look odd: {odd}");
    sink.repaired(file, "", what);
    Ok(Cow::Owned(text.into_bytes()))
}

pub(super) fn parse<'a, T: Deserialize<'a>>(file: &str, json: &'a [u8]) -> Result<T, LoadError> {
    serde_json::from_slice(json).map_err(|error| {
        let text = error.to_string();
        let reason = text.split(" at line ").next().unwrap_or_default();
        let place = format!("line {} column {}", error.line(), error.column());
        LoadError::broken(file, place, format!("not valid glTF JSON: {reason}"))
    })
}

/// The whole tree, and what is read a second time; once more where that fails without what `gltf::json` knows less of
/// than the format (animations, of which it has only those of nodes; scenes, to which it denies being empty; whole
/// numbers that some write as `4.0`).
pub(super) fn parse_tree(file: &str, json: &[u8], budget: &Budget) -> Result<(Root, More), LoadError> {
    let (tree, more) = match (parse(file, json), parse(file, json)) {
        (Ok(tree), Ok(more)) => return Ok((tree, more)),
        either => either,
    };
    let [objects, values] = objects_and_values(json);
    let memory = objects * OBJECT_MEMORY + 2 * values * VALUE_MEMORY + json.len() as u64;
    budget.take(memory, file, "JSON")?;
    let mut value: serde_json::Value = parse(file, json)?;
    write_without_point(&mut value);
    let more = more.or_else(|why| More::deserialize(&value).map_err(|_| why))?;
    if let Some(root) = value.as_object_mut() {
        root.remove("animations");
        let scenes = root.get_mut("scenes").and_then(|scenes| scenes.as_array_mut());
        for scene in scenes.into_iter().flatten().filter_map(|scene| scene.as_object_mut()) {
            scene.entry("nodes").or_insert_with(|| serde_json::Value::Array(Vec::new()));
        }
    }
    let tree = tree.or_else(|why| serde_json::from_value(value).map_err(|_| why))?;
    Ok((tree, more))
}

/// Makes whole numbers of those that are written as `4.0`, to all depths (`serde_json` allows 128).
fn write_without_point(value: &mut serde_json::Value) {
    match value {
        serde_json::Value::Number(number) => {
            // Up to here all whole numbers are different numbers in double precision.
            let whole =
                number.as_f64().filter(|v| number.is_f64() && v.fract() == 0.0 && v.abs() < 2_f64.powi(53));
            if let Some(whole) = whole {
                *number = (whole as i64).into();
            }
        }
        serde_json::Value::Array(items) => items.iter_mut().for_each(write_without_point),
        serde_json::Value::Object(members) => members.values_mut().for_each(write_without_point),
        _ => {}
    }
}
