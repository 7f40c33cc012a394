//! The things that a file names, each a mesh of its own: who clicks a chair means the chair.
//!
//! They are what `o` names or, where no two objects have faces, what `g` does. A file of very many of them is one thing: so
//! many boxes overlap that rays would pay for it, and nobody picks one by one.

use crate::scene::TriangleMesh;
use std::collections::HashMap;

/// With more named things than this a file is one thing.
pub(super) const MOST_PARTS: usize = 512;
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
        self.crowded || self.names.len() > MOST_PARTS
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

/// What is to be said of a file that is one thing for it has too many.
pub(super) fn told(objects: &Names, groups: &Names) -> Option<String> {
    let crowded = [(objects, "objects (`o`)"), (groups, "groups (`g`)")];
    let (_, what) = crowded.into_iter().find(|(names, _)| names.is_crowded())?;
    Some(format!("more than {MOST_PARTS} {what}: they are one thing, to be moved as a whole"))
}

/// What a file is made of: for each face its part, and their names.
pub(super) fn parts(objects: &Names, groups: &Names, faces: usize) -> Option<(Vec<u32>, Vec<String>)> {
    objects.parts(faces).or_else(|| groups.parts(faces))
}

/// Triangles of `mesh` by their `part`, of which there are `count`; and of each which of the slots it has.
pub(super) fn split(mesh: &TriangleMesh, part: &[u32], count: usize) -> Vec<(TriangleMesh, Vec<u16>)> {
    const NONE: u32 = u32::MAX;
    let mut triangles: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (triangle, &part) in part.iter().enumerate() {
        triangles[part as usize].push(triangle as u32);
    }
    // By vertex of the whole, the part that used it last and what it is called there.
    let mut called = vec![(NONE, 0); mesh.positions.len()];
    let own = |(part, triangles): (u32, Vec<u32>)| {
        let mut vertices: Vec<u32> = Vec::new();
        let mut slots: Vec<u16> = Vec::new();
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
            let slot = mesh.slot(triangle as usize) as u16;
            let known = slots.iter().position(|&known| known == slot).unwrap_or_else(|| {
                slots.push(slot);
                slots.len() - 1
            });
            split.slots.push(known as u16);
        }
        if slots.len() < 2 {
            split.slots = Vec::new();
        }
        split.positions = taken(&mesh.positions, &vertices);
        split.normals = taken(&mesh.normals, &vertices);
        split.uvs = taken(&mesh.uvs, &vertices);
        split.colors = taken(&mesh.colors, &vertices);
        (split, slots)
    };
    (0..).zip(triangles).map(own).collect()
}

/// Of these vertices, if there are any values.
fn taken<T: Copy>(values: &[T], vertices: &[u32]) -> Vec<T> {
    if values.is_empty() { Vec::new() } else { vertices.iter().map(|&v| values[v as usize]).collect() }
}
