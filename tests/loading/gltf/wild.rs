//! glTF as it is met: what is left out or mended, and what asks for too much.

use super::super::builder::{Builder, TRIANGLE};
use super::*;

#[test]
fn a_primitive_without_positions_costs_only_itself() {
    let text = gltf_triangle("", "", "")
        .replace(r#""primitives":["#, r#""primitives":[{"attributes":{"NORMAL":2}},{"attributes":{}},"#);
    let (_, report) = loaded("a.gltf", &text);
    assert_eq!(report.triangles, 1);
    assert_says(&report.warnings().join("\n"), "no POSITION: nothing says where its vertices are: 2");
}
