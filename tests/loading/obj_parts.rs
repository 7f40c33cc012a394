//! What an OBJ file names is a thing of its own.

use super::*;

/// A name and its materials, in the order of the file.
fn parts(world: &mut World) -> Vec<(String, Vec<String>, usize)> {
    let mut parts: Vec<_> = world
        .query::<(Entity, &Instance, &Name)>()
        .iter(world)
        .map(|(entity, instance, name)| (entity, instance.clone(), name.to_string()))
        .collect();
    parts.sort_by_key(|(entity, ..)| entity.index_u32());
    let of = |(_, instance, name): (Entity, Instance, String)| {
        let materials = instance.materials.iter().map(|&m| world.get::<Name>(m).unwrap().to_string());
        let mesh = &world.get::<Mesh>(instance.mesh).unwrap().0;
        (name, materials.collect(), mesh.triangles.len())
    };
    parts.into_iter().map(of).collect()
}

fn part(name: &str, materials: &[&str], triangles: usize) -> (String, Vec<String>, usize) {
    (name.to_owned(), materials.iter().map(|&m| m.to_owned()).collect(), triangles)
}

#[test]
fn objects_are_things_with_their_own_materials() {
    let text = format!(
        "mtllib a.mtl\n{QUAD}f 1 2 3\no left chair\nusemtl red\nf 1 2 3 4\nusemtl blue\nf 1 2 3\no right\nf 1 3 4\n\
         usemtl red\no empty\no left chair\nf 2 3 4\n"
    );
    let mtl = b"newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n";
    let (mut world, report) = loaded_all(&[("a.obj", text.as_bytes()), ("a.mtl", mtl)]);
    let found = parts(&mut world);
    let (unnamed, others) = found.split_first().unwrap();
    assert_eq!((unnamed.0.as_str(), unnamed.2), ("unnamed", 1), "what stands before the first name");
    assert_eq!(others, [part("left chair", &["red", "blue"], 4), part("right", &["blue"], 1)]);
    assert_eq!(report.triangles, 6);
    let chair =
        world.query::<(&Name, &Instance)>().iter(&world).find(|(name, _)| name.as_str() == "left chair");
    let mesh = chair.unwrap().1.mesh;
    assert_eq!(world.get::<Mesh>(mesh).unwrap().0.slots, [0, 0, 1, 0]);
}

#[test]
fn groups_are_things_where_objects_are_not() {
    let name = |text: &str| {
        let (mut world, _) = loaded("a.obj", &format!("{QUAD}{text}"));
        parts(&mut world).into_iter().map(|(name, ..)| name).collect::<Vec<_>>()
    };
    assert_eq!(name("g default\ng lid top\nf 1 2 3\ng pot\nf 1 3 4\n"), ["lid top", "pot"]);
    assert_eq!(name("o scene\ng lid\nf 1 2 3\ng pot\nf 1 3 4\n"), ["lid", "pot"]);
    assert_eq!(name("o a\ng lid\nf 1 2 3\no b\ng pot\nf 1 3 4\ng lid\nf 1 2 4\n"), ["a", "b"]);
    // A file of one thing is that thing.
    assert_eq!(name("o scene\nf 1 2 3\ng pot\nf 1 3 4\ng pot\nf 1 2 4\n").len(), 2);
    for text in ["o a\nf 1 2 3\nf 1 3 4\n", "g a\nf 1 2 3\ng a\nf 1 3 4\n", "f 1 2 3\n"] {
        assert_eq!(name(text).len(), 1, "{text}");
        assert_ne!(name(text), ["unnamed"]);
    }
}

/// Apart or together, the surface is the same: also normals of a smoothing group and the directions of a normal map that go on in
/// another object.
#[test]
fn parts_together_are_the_whole() {
    let roof = "v 0 0 0\nv 1 1 0\nv 2 0 0\nv 0 0 -1\nv 1 1 -1\nv 2 0 -1\nvt 0 0\nvt 1 0\nvt 1 1\n";
    let faces = ["s 1\nf 1/1 2/2 5/3 4/1\n", "f 2/2 3/1 6/1 5/3\n", "s 0\nf 1/1 2/2 3/3\n"];
    let corners = |text: &str| {
        let text = format!("mtllib a.mtl\nusemtl m\n{text}");
        let mtl = b"newmtl m\nnorm n.png\n";
        let files = [("a.obj", text.as_bytes()), ("a.mtl", mtl), ("n.png", &png([128, 128, 255, 255]))];
        let (mut world, _) = loaded_all(&files);
        let mut corners = Vec::new();
        for mesh in world.query::<&Mesh>().iter(&world) {
            let mesh = &mesh.0;
            let bits = |v: DVec3| v.to_array().map(|x| (x + 0.0).to_bits());
            corners.extend(mesh.triangles.iter().map(|triangle| {
                triangle.map(|vertex| {
                    let vertex = vertex as usize;
                    let uv = mesh.uvs[vertex].as_dvec2().extend(0.0);
                    let tangent = mesh.tangents[vertex].truncate().as_dvec3();
                    [mesh.positions[vertex].as_dvec3(), mesh.normals[vertex].as_dvec3(), uv, tangent]
                        .map(bits)
                })
            }));
        }
        corners.sort_unstable();
        corners
    };
    let whole = corners(&format!("{roof}{}", faces.concat()));
    let [a, b, c] = faces;
    assert_eq!(corners(&format!("{roof}o a\n{a}o b\n{b}o c\n{c}")), whole);
    assert_eq!(whole.len(), 5);
}

/// Things that nobody picks one by one, and names without end.
#[test]
fn very_many_things_are_one_and_that_is_said() {
    let apart = |count: usize, statement: &dyn Fn(usize) -> String| -> String {
        let corners = |n: usize| format!("v {n} 0 0\nv {n} 1 0\nv {n} 0 1\n");
        (0..count).map(|n| format!("{}{}f -1 -2 -3\n", corners(n), statement(n))).collect()
    };
    let object = |n: usize| format!("o thing {n}\n");
    let sides = |n: usize| format!("o thing {n}\ng {}\n", if n < 300 { "left" } else { "right" });
    let empty = |n: usize| format!("o curve {n}\no thing {}\n", n % 2);
    for (count, statement, things, words) in [
        (512, &object as &dyn Fn(usize) -> String, 512, ""),
        (513, &object, 1, "more than 512 objects (`o`): they are one thing"),
        (30_000, &object, 1, "they are one thing"),
        (30_000, &|n| format!("g thing {n}\n"), 1, "more than 512 groups (`g`): they are one thing"),
        (600, &sides, 2, "more than 512 objects (`o`): its groups (`g`) are things instead"),
        (600, &empty, 2, ""),
    ] {
        let (mut world, report) = loaded("a.obj", &apart(count, statement));
        assert_eq!(parts(&mut world).len(), things, "{count}, {words}");
        assert_eq!(report.triangles, count);
        let said = report.decisions().join("\n");
        assert!(if words.is_empty() { !said.contains("one thing") } else { said.contains(words) }, "{said}");
    }
}

/// Rays would have to enter each of their boxes.
#[test]
fn things_that_lie_through_one_another_are_one() {
    let leaves = |kinds: usize| -> String {
        let leaf = |n: usize| {
            let (x, y) = (n % 10, n / 10);
            format!(
                "v {x} {y} 0\nv {x}.5 {y} 0\nv {x} {y}.5 1\ng kind {}\nusemtl m{}\nf -1 -2 -3\n",
                n % kinds,
                n % 2
            )
        };
        (0..100).map(leaf).collect()
    };
    let (mut world, report) = loaded("a.obj", &leaves(3));
    assert_eq!(parts(&mut world).len(), 3);
    assert!(!report.decisions().join("\n").contains("one thing"));
    let (mut world, report) = loaded("a.obj", &leaves(17));
    let found = parts(&mut world);
    assert_eq!((found.len(), found[0].2, found[0].1.len()), (1, 100, 2));
    assert_eq!(only_mesh(&mut world).slots, [0, 1].repeat(50));
    assert_says(
        &report.decisions().join("\n"),
        "its objects or groups lie through one another, or have too many materials: they are one thing",
    );
}

/// As many materials as a mesh has slots, in one object or in two, and more together than that.
#[test]
fn materials_without_end_are_worn_by_their_own_parts() {
    let faces = |count: usize| -> String { (0..count).map(|n| format!("usemtl m{n}\nf 1 2 3\n")).collect() };
    for (text, things, worn) in [
        (format!("{QUAD}{}", faces(65_536)), 1, 65_536),
        (format!("{QUAD}o a\n{0}o b\n{0}", faces(20_000)), 2, 20_000),
        (format!("{QUAD}o a\n{0}o b\n{0}", faces(40_000)), 1, 40_000),
    ] {
        let mtl: String = (0..worn).map(|n| format!("newmtl m{n}\n")).collect();
        let text = format!("mtllib a.mtl\n{text}");
        let (mut world, report) = loaded_all(&[("a.obj", text.as_bytes()), ("a.mtl", mtl.as_bytes())]);
        assert_eq!(report.warnings(), [""; 0]);
        assert_eq!(world.query::<&Instance>().iter(&world).count(), things);
        for instance in world.query::<&Instance>().iter(&world) {
            let mesh = &world.get::<Mesh>(instance.mesh).unwrap().0;
            assert_eq!((instance.materials.len(), mesh.triangles.len() % worn), (worn, 0));
            // Each triangle wears what its face says.
            assert!((0..mesh.triangles.len()).all(|triangle| mesh.slot(triangle) == triangle % worn));
        }
        let said = report.decisions().join("\n").contains("too many materials: they are one thing");
        assert_eq!(said, worn == 40_000);
    }
}

/// Far from zero all parts are counted from one place.
#[test]
fn parts_of_a_map_stay_where_they_are() {
    let text = "v 500000 0 0\nv 500001 0 0\nv 500001 1 0\nv 500000 1 0\no a\nf 1 2 3\no b\nf 1 3 4\n";
    let (mut world, _) = loaded("a.obj", text);
    let mut query = world.query_filtered::<&GlobalTransform, With<Instance>>();
    let places: Vec<_> = query.iter(&world).map(|global| global.0.translation).collect();
    assert_eq!(places.len(), 2);
    assert!(places.iter().all(|place| *place == places[0] && place.x > 1e5), "{places:?}");
}
