//! Files that are no scene at all, whatever their names say.

/// What a file is that begins like this, and the way out; none if it may be a scene.
pub(super) fn not_a_scene(bytes: &[u8]) -> Option<&'static str> {
    const KNOWN: [(&[u8], &str); 20] = [
        (
            b"version https://git-lfs",
            "a pointer of Git LFS, not the file it stands for: fetch that with `git lfs pull`",
        ),
        (b"PK\x03\x04", "a ZIP archive: unpack it and open the scene in it"),
        (b"\x1f\x8b", "compressed with gzip: unpack it first"),
        (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive: unpack it and open the scene in it"),
        (b"Rar!\x1a\x07", "a RAR archive: unpack it and open the scene in it"),
        (b"\x28\xb5\x2f\xfd", "compressed with Zstandard: unpack it first"),
        (b"BZh", "compressed with bzip2: unpack it first"),
        (b"\xfd7zXZ\0", "compressed with xz: unpack it first"),
        (b"\xff\xfe", "text in UTF-16: save it as UTF-8"),
        (b"\xfe\xff", "text in UTF-16: save it as UTF-8"),
        (b"Kaydara FBX", "an FBX file: export it as glTF"),
        (b"; FBX", "an FBX file: export it as glTF"),
        (b"BLENDER", "a Blender file: open it in Blender and export it as glTF"),
        (b"ply\n", "a PLY file: convert it to glTF or OBJ"),
        (b"ply\r", "a PLY file: convert it to glTF or OBJ"),
        (b"#usda", "a USD file: convert it to glTF"),
        (b"PXR-USDC", "a USD file: convert it to glTF"),
        (b"%PDF", "a PDF file, not a scene"),
        (b"\x89PNG", "a picture in PNG format, not a scene"),
        (b"\xff\xd8\xff", "a picture in JPEG format, not a scene"),
    ];
    if let Some((_, what)) = KNOWN.iter().find(|(magic, _)| bytes.starts_with(magic)) {
        return Some(what);
    }
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    if !text.starts_with(b"<") {
        return None;
    }
    let head = &text[..text.len().min(1024)];
    if head.windows(8).any(|word| word == b"<COLLADA") {
        return Some("a COLLADA file: convert it to glTF");
    }
    Some(
        "a web page or XML, not a scene: the download went wrong, or the link leads to a page about the file",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_scene_is_named() {
        let named = |bytes: &[u8]| not_a_scene(bytes).unwrap_or_default();
        assert!(
            named(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n").contains("git lfs pull")
        );
        assert!(named(b"\n <!DOCTYPE html><html>").contains("web page"));
        assert!(named(b"<?xml version=\"1.0\"?>\n<COLLADA xmlns=\"\">").contains("COLLADA"));
        assert!(named(b"PK\x03\x04....").contains("ZIP"));
        assert!(named(b"\xff\xfe{\0").contains("UTF-16"));
        for scene in
            [&b"glTF\x02\0\0\0"[..], b"{\"asset\":{}}", b"# Blender 4\nv 0 0 0\n", b"", b"\xef\xbb\xbf{}"]
        {
            assert_eq!(not_a_scene(scene), None);
        }
    }
}
