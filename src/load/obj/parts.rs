//! The things that a file names, each a mesh of its own: who clicks a chair means the chair.
//!
//! They are what `o` names or, where no two objects have faces, what `g` does. A file of very many of them is one thing: nobody
//! picks these one by one. So is one whose parts lie through one another, as leaves of one kind or all that is of one material:
//! each ray would have to enter all of their boxes.

use super::raw::Face;
use crate::bvh::Aabb;
use crate::scene::TriangleMesh;
use std::collections::{HashMap, HashSet};

/// With more named things than this a file is one thing.
pub(super) const MOST_PARTS: usize = 512;
/// So often the boxes of the parts may cover that of the whole. With 16 to 500 that each fill it rays took 2.3 to 22 times as long.
pub(super) const MOST_OVERLAP: f64 = 4.0;
/// Letters of a name.
const MOST_LETTERS: usize = 200;
/// Stretches of faces under one name: many names may take turns.
const MOST_RUNS: usize = 1 << 16;

/// Which names the faces of a file stand under.
#[derive(Default)]
pub(super) struct Names {
    /// The first face under each name, in their order, and the name's number.
    runs: Vec<(u32, u32)>,
    names: Vec<String>,
    known: HashMap<String, u32>,
    /// There are too many.
    crowded: bool,
}

impl Names {
    /// The faces from `face` on stand under `name`.
    pub(super) fn begin(&mut self, name: &str, face: usize) {
        if self.crowded {
            return;
        }
        let name: String = name.trim().chars().take(MOST_LETTERS).collect();
        let number = match self.known.get(&name) {
            Some(&number) => number,
            None => {
                let number = self.names.len() as u32;
                self.known.insert(name.clone(), number);
                self.names.push(name);
                number
            }
        };
        // Of names without a face between them the last counts.
        while self.runs.last().is_some_and(|&(first, _)| first as usize == face) {
            self.runs.pop();
        }
        if self.runs.last().is_none_or(|&(_, last)| last != number) {
            self.runs.push((face as u32, number));
        }
        // There may be names without faces, but not any number of them.
        self.crowded = self.names.len() > 4 * MOST_PARTS || self.runs.len() > MOST_RUNS;
    }

    /// Whether no part of the file is a thing of its own because there are too many.
    fn is_crowded(&self) -> bool {
        self.crowded || self.runs.iter().map(|(_, name)| name).collect::<HashSet<_>>().len() > MOST_PARTS
    }

    /// For each face the number of its part, and the names of the parts in the order of their first faces; nothing if all are one.
    fn parts(&self, faces: usize) -> Option<(Vec<u32>, Vec<String>)> {
        let mut part_of = HashMap::new();
        let mut names = Vec::new();
        let mut numbers = Vec::with_capacity(faces);
        // What stands before the first name has none.
        let first = self.runs.first().map_or(faces, |&(face, _)| face as usize);
        let ends = self.runs.iter().skip(1).map(|&(face, _)| face as usize).chain([faces]);
        let named = self.runs.iter().zip(ends).map(|(&(face, name), end)| (face as usize, end, Some(name)));
        for (from, to, name) in [(0, first, None)].into_iter().chain(named).filter(|(from, to, _)| from < to)
        {
            let number = *part_of.entry(name).or_insert_with(|| {
                let of_name = |name| self.names[name as usize].clone();
                names.push(name.map_or_else(|| "unnamed".to_owned(), of_name));
                names.len() as u32 - 1
            });
            numbers.resize(numbers.len() + (to - from), number);
        }
        (!self.crowded && (2..=MOST_PARTS).contains(&names.len())).then_some((numbers, names))
    }
}

/// Parts of a file: for each face its part, and their names; nothing if all are one.
pub(super) fn of_faces(objects: &Names, groups: &Names, faces: usize) -> (Vec<u32>, Vec<String>) {
    objects.parts(faces).or_else(|| groups.parts(faces)).unwrap_or_default()
}

/// What is to be said of a file with so many `named` parts that are not all things of their own, or no things at all.
pub(super) fn told(objects: &Names, groups: &Names, named: usize, is_parted: bool) -> Option<String> {
    let why = match (objects.is_crowded(), groups.is_crowded()) {
        (true, _) => format!("more than {MOST_PARTS} objects (`o`)"),
        (false, true) if named < 2 => format!("more than {MOST_PARTS} groups (`g`)"),
        _ if named > 1 && !is_parted => {
            "its objects or groups lie through one another, or have too many materials".to_owned()
        }
        _ => return None,
    };
    let instead = if is_parted { "its groups (`g`) are things instead" } else { "they are one thing" };
    Some(format!("{why}: {instead}"))
}

/// What of a part has one material. In a mesh of the whole these are the slots.
#[derive(Default)]
pub(super) struct Kinds {
    /// By face.
    pub(super) of_faces: Vec<u16>,
    /// By kind: part and material.
    pub(super) kinds: Vec<(u32, u16)>,
}

impl Kinds {
    /// Of faces in these parts; in one, if these are none or give more kinds than a mesh has slots.
    pub(super) fn new(faces: &[Face], parts: &[u32]) -> Self {
        Self::of(faces, parts).or_else(|| Self::of(faces, &[])).unwrap_or_default()
    }

    fn of(faces: &[Face], parts: &[u32]) -> Option<Self> {
        let (mut kinds, mut known) = (Vec::new(), HashMap::new());
        let mut of_faces = Vec::with_capacity(faces.len());
        let mut last = None;
        for (i, face) in faces.iter().enumerate() {
            let kind = (parts.get(i).copied().unwrap_or(0), face.material);
            let number = match last.filter(|(before, _)| *before == kind) {
                Some((_, number)) => number,
                None => *known.entry(kind).or_insert_with(|| {
                    kinds.push(kind);
                    kinds.len() - 1
                }),
            };
            last = Some((kind, number));
            of_faces.push(u16::try_from(number).ok()?);
        }
        Some(Self { of_faces, kinds })
    }

    /// How many parts they are of.
    pub(super) fn parts(&self) -> usize {
        self.kinds.iter().map(|&(part, _)| part as usize + 1).max().unwrap_or(0)
    }

    /// The whole mesh with materials as slots; and all of these.
    pub(super) fn as_materials(&self, mut mesh: TriangleMesh) -> (TriangleMesh, Vec<u16>) {
        let last = self.kinds.iter().map(|&(_, material)| material).max().unwrap_or(0);
        if last == 0 {
            mesh.slots = Vec::new();
        }
        for slot in &mut mesh.slots {
            *slot = self.kinds[usize::from(*slot)].1;
        }
        (mesh, (0..=last).collect())
    }

    /// How often boxes of the parts cover that of the whole, by their areas: so many hierarchies a ray has to enter. `mesh` has
    /// these kinds as slots.
    pub(super) fn overlap(&self, mesh: &TriangleMesh) -> f64 {
        let mut boxes = vec![Aabb::EMPTY; self.parts()];
        for triangle in 0..mesh.triangles.len() {
            let own = &mut boxes[self.kinds[mesh.slot(triangle)].0 as usize];
            *own = mesh.corners(triangle).into_iter().fold(*own, Aabb::with);
        }
        let whole = boxes.iter().fold(Aabb::EMPTY, |whole, own| whole.union(*own));
        let area = |aabb: &Aabb| if aabb.is_empty() { 0.0 } else { f64::from(aabb.half_area()) };
        boxes.iter().map(area).sum::<f64>() / area(&whole).max(f64::MIN_POSITIVE)
    }
}

/// The parts of `mesh`, whose slots are `kinds`; and of each which materials its slots are.
pub(super) fn split(
    mesh: &TriangleMesh,
    kinds: &[(u32, u16)],
    parts: usize,
) -> Vec<(TriangleMesh, Vec<u16>)> {
    const NONE: u32 = u32::MAX;
    let mut triangles: Vec<Vec<u32>> = vec![Vec::new(); parts];
    for triangle in 0..mesh.triangles.len() {
        triangles[kinds[mesh.slot(triangle)].0 as usize].push(triangle as u32);
    }
    // By vertex of the whole, the part that used it last and what it is called there; by kind its slot in its part.
    let mut called = vec![(NONE, 0); mesh.positions.len()];
    let mut slot_of = vec![u16::MAX; kinds.len()];
    let own = |(part, triangles): (u32, Vec<u32>)| {
        let mut vertices: Vec<u32> = Vec::new();
        let mut materials: Vec<u16> = Vec::new();
        let mut split = TriangleMesh::default();
        for triangle in triangles {
            let corners = mesh.triangles[triangle as usize].map(|vertex| {
                let place = &mut called[vertex as usize];
                if place.0 != part {
                    *place = (part, vertices.len() as u32);
                    vertices.push(vertex);
                }
                place.1
            });
            split.triangles.push(corners);
            let kind = mesh.slot(triangle as usize);
            if slot_of[kind] == u16::MAX {
                slot_of[kind] = materials.len() as u16;
                materials.push(kinds[kind].1);
            }
            split.slots.push(slot_of[kind]);
        }
        if materials.len() < 2 {
            split.slots = Vec::new();
        }
        split.positions = taken(&mesh.positions, &vertices);
        split.normals = taken(&mesh.normals, &vertices);
        split.uvs = taken(&mesh.uvs, &vertices);
        split.tangents = taken(&mesh.tangents, &vertices);
        split.colors = taken(&mesh.colors, &vertices);
        (split, materials)
    };
    (0..).zip(triangles).map(own).collect()
}

/// Of these vertices, if there are any values.
fn taken<T: Copy>(values: &[T], vertices: &[u32]) -> Vec<T> {
    if values.is_empty() { Vec::new() } else { vertices.iter().map(|&v| values[v as usize]).collect() }
}
