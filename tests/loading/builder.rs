//! glTF files with binary data, put together piece by piece.

use super::base64;

/// Buffer views and accessors of one embedded buffer.
#[derive(Default)]
pub struct Builder {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Builder {
    /// A buffer view of these bytes with more JSON in it; its index.
    pub fn view(&mut self, bytes: &[u8], more: &str) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let (offset, length) = (self.bytes.len(), bytes.len());
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}{more}}}"#));
        self.bytes.extend(bytes);
        self.views.len() - 1
    }

    /// An accessor over a view, described by JSON; its index.
    pub fn accessor(&mut self, view: usize, json: &str) -> usize {
        self.accessors.push(format!(r#"{{"bufferView":{view},{json}}}"#));
        self.accessors.len() - 1
    }

    /// An accessor of single-precision numbers of a type such as `VEC3`; its index.
    pub fn floats(&mut self, kind: &str, numbers: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let view = self.view(&bytes, "");
        let count = numbers.len() / width;
        self.accessor(view, &format!(r#""componentType":5126,"count":{count},"type":"{kind}""#))
    }

    /// An accessor of bytes, four a vertex.
    pub fn bytes4(&mut self, bytes: &[[u8; 4]], normalized: bool) -> usize {
        let view = self.view(bytes.as_flattened(), "");
        let count = bytes.len();
        let json = format!(r#""componentType":5121,"count":{count},"type":"VEC4","normalized":{normalized}"#);
        self.accessor(view, &json)
    }

    /// The file, with the rest of its JSON (beginning with a key).
    pub fn finish(&self, rest: &str) -> String {
        let (views, accessors, length) = (self.views.join(","), self.accessors.join(","), self.bytes.len());
        let data = base64(&self.bytes);
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{length},"uri":"data:;base64,{data}"}}],"bufferViews":[{views}],"accessors":[{accessors}],{rest}}}"#
        )
    }
}

/// A triangle's positions.
pub const TRIANGLE: [f32; 9] = [0., 0., 0., 1., 0., 0., 0., 1., 0.];
