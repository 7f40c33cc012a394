//! glTF as it is met: what is left out or mended, and what asks for too much.

use super::*;

#[test]
fn a_primitive_without_positions_costs_only_itself() {
    let text = gltf_triangle("", "", "")
        .replace(r#""primitives":["#, r#""primitives":[{"attributes":{"NORMAL":2}},{"attributes":{}},"#);
    let (_, report) = loaded("a.gltf", &text);
    assert_eq!(report.triangles, 1);
    assert_says(&report.warnings().join("\n"), "no POSITION: nothing says where its vertices are: 2");
}

fn textured(uri: &str) -> String {
    let more = format!(
        r#","materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],"textures":[{{"source":0}}],"images":[{{"uri":"{uri}"}}]"#
    );
    gltf_triangle("", r#","material":0"#, &more)
}

#[test]
fn a_picture_that_is_not_where_the_file_says_is_looked_for_beside_the_scene() {
    for uri in [
        "C:\\\\Users\\\\me\\\\a%20b.png",
        "../a b.png",
        "a%20b.png?v=1",
        "https://example.com/a%20b.png",
        "gone/a b.png",
    ] {
        let (mut world, report) =
            loaded_all(&[("a.gltf", textured(uri).as_bytes()), ("a b.png", &png([1, 2, 3, 4]))]);
        assert_eq!(world.query::<&Texture>().single(&world).unwrap().texels.texels, [[1, 2, 3, 4]], "{uri}");
        assert_says(&report.warnings().join("\n"), "beside the scene instead");
    }
    let why = |uri: &str| loaded("a.gltf", &textured(uri)).1.warnings().join("\n");
    assert_says(
        &why("../gone.png"),
        "lies outside the scene's folder and is not opened; put the file beside the scene;",
    );
    assert_says(&why(""), "empty URI");
}

#[test]
fn what_is_something_else_is_named_with_the_way_out() {
    assert_says(
        &refusal("a.glb", "version https://git-lfs.github.com/spec/v1\noid sha256:00\n"),
        "git lfs pull",
    );
    assert_says(&refusal("a.glb", "<!DOCTYPE html>\n<html></html>"), "content: is a web page");
    assert_says(&refusal("a.gltf", "PK\u{3}\u{4}"), "content: is a ZIP archive: unpack it");
}

#[test]
fn a_name_in_latin_1_costs_nothing() {
    let text = gltf_triangle(r#","name":"caf@""#, "", "").into_bytes();
    let text: Vec<u8> = text.into_iter().map(|byte| if byte == b'@' { 0xe9 } else { byte }).collect();
    let (mut world, report) = loaded_all(&[("a.gltf", &text)]);
    named::<GlobalTransform>(&mut world, "café");
    assert_says(&report.warnings().join("\n"), "not UTF-8");
}
