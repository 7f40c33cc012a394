//! The file format: everything comes back, and nothing but a whole film is taken for one.

use super::{encode, fails, fresh, made_up, succeeds};
use glam::UVec2;
use penumbra::farm::{FilmError, FilmFile, Fingerprint, Ranges};
use proptest::prelude::*;
use std::path::Path;

fn decode(bytes: &[u8]) -> Result<FilmFile, FilmError> {
    FilmFile::decode(Path::new("some.film"), bytes)
}

/// With a checksum that fits, as only somebody who wants to do harm would make it.
fn forged(mut bytes: Vec<u8>) -> Vec<u8> {
    let content = bytes.len().saturating_sub(16);
    if content >= 24 {
        let length = bytes.len() as u64;
        bytes[16..24].copy_from_slice(&length.to_le_bytes());
        let mut print = Fingerprint::default();
        print.bytes(&bytes[..content]);
        bytes.truncate(content);
        bytes.extend_from_slice(&print.finish().to_le_bytes());
    }
    bytes
}

fn uneven() -> FilmFile {
    made_up(UVec2::new(35, 20), Some(4..40), |tile| {
        let mut ranges = Ranges::from(4..20 + tile as u32);
        ranges.unite(&Ranges::from(30..30 + tile as u32 * 2));
        ranges
    })
}

#[test]
fn a_film_comes_back_as_it_was() {
    for file in [
        uneven(),
        made_up(UVec2::ONE, None, |_| Ranges::default()),
        made_up(UVec2::new(16, 16), Some(0..3), |_| Ranges::from(0..3)),
        made_up(UVec2::new(17, 1), None, |_| Ranges::from(u32::MAX - 9..u32::MAX)),
    ] {
        let bytes = encode(&file);
        let back = decode(&bytes).unwrap();
        assert!(back == file, "{:?}", file.held);
        assert_eq!(encode(&back), bytes);
    }
}

#[test]
fn whatever_bit_is_flipped_somebody_notices() {
    let bytes = encode(&uneven());
    let mut damaged = bytes.clone();
    // Every bit of the head and the header's start, then a bit here and there.
    let places = (0..100 * 8).chain((100 * 8..bytes.len() * 8).step_by(997)).chain([bytes.len() * 8 - 1]);
    for bit in places {
        damaged[bit / 8] ^= 1 << (bit % 8);
        let error = decode(&damaged).expect_err("damaged");
        let line = error.to_string();
        assert!(line.starts_with("some.film: ") && !line.contains('\n'), "{line}");
        damaged[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(decode(&damaged).is_ok());
}

#[test]
fn wherever_it_is_cut_somebody_notices() {
    let bytes = encode(&uneven());
    for length in (0..100).chain((100..bytes.len()).step_by(101)).chain([bytes.len() - 1]) {
        assert!(decode(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
        let line = decode(&forged(bytes[..length].to_vec())).expect_err("forged").to_string();
        assert!(line.starts_with("some.film: "), "{line}");
    }
    let longer = [bytes, vec![0; 10]].concat();
    assert!(matches!(decode(&longer), Err(FilmError::Length { .. })));
    assert!(matches!(decode(&forged(longer)), Err(FilmError::Broken { .. })));
}

#[test]
fn sizes_that_the_file_cannot_hold_are_not_believed() {
    let text = |file: &FilmFile| serde_json::to_string(&file.header).unwrap();
    let file = uneven();
    let bytes = encode(&file);
    let json = text(&file);
    for (from, to) in [
        ("\"width\":35", "\"width\":16384"),
        ("\"width\":35", "\"width\":4294967295"),
        ("\"width\":35", "\"width\":0"),
        ("\"width\":35", "\"width\":-1"),
        ("\"height\":20", "\"height\":1e9"),
        ("\"seed\":0", "\"seed\":0,\"more\":0"),
        ("\"exposure\":0.0", "\"exposure\":null"),
    ] {
        assert!(json.contains(from), "{json}");
        let changed = json.replace(from, to);
        let mut other = bytes[..12].to_vec();
        other.extend_from_slice(&(changed.len() as u32).to_le_bytes());
        other.extend_from_slice(&[0; 8]);
        other.extend_from_slice(changed.as_bytes());
        other.extend_from_slice(&bytes[24 + json.len()..]);
        let line = decode(&forged(other)).expect_err(to).to_string();
        assert!(line.starts_with("some.film: header: "), "{line}");
    }
}

#[test]
fn no_file_that_is_no_film_is_taken_for_one() {
    let folder = fresh("foreign");
    succeeds(
        &folder,
        &["render", "cornell", "--spp", "1", "--resolution", "40x30", "-o", "a.film", "-o", "a.png"],
    );
    let film = std::fs::read(folder.join("a.film")).unwrap();
    std::fs::write(folder.join("short.film"), &film[..film.len() / 2]).unwrap();
    std::fs::write(folder.join("empty.film"), b"").unwrap();
    std::fs::create_dir(folder.join("folder.film")).unwrap();
    std::fs::copy(folder.join("a.png"), folder.join("png.film")).unwrap();
    let mut flipped = film.clone();
    *flipped.last_mut().unwrap() ^= 1;
    std::fs::write(folder.join("flipped.film"), &flipped).unwrap();
    let mut newer = film;
    newer[8] = 2;
    std::fs::write(folder.join("newer.film"), &newer).unwrap();
    for (name, words) in [
        ("none.film", vec!["no such file or folder; check the name"]),
        ("short.film", vec!["bytes", "copy it again"]),
        ("empty.film", vec!["not a film"]),
        ("folder.film", vec!["not a film"]),
        ("png.film", vec!["not a film", "render"]),
        ("flipped.film", vec!["checksum", "damaged", "copy it again"]),
        ("newer.film", vec!["format 2", "format 1"]),
    ] {
        let words = [vec![name], words].concat();
        fails(&folder, &["merge", name, "-o", "x.png"], &words);
        fails(
            &folder,
            &["render", "cornell", "--resolution", "40x30", "--resume", name, "-o", "x.png"],
            &words,
        );
        fails(
            &folder,
            &["render", "cornell", "--resolution", "40x30", "--reference", name, "--error-log", "x.csv"],
            &words,
        );
    }
    assert!(!folder.join("x.png").exists());
}

/// A file of terabytes that says so itself, on a file system that does not store its zeros.
#[cfg(target_os = "linux")]
#[test]
fn a_file_too_large_for_its_head_is_not_read() {
    let folder = fresh("large");
    let length = 4u64 << 40;
    let mut head = encode(&uneven())[..24].to_vec();
    head[16..24].copy_from_slice(&(7u64).to_le_bytes());
    let path = folder.join("large.film");
    std::fs::write(&path, &head).unwrap();
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    if file.set_len(length).is_err() {
        eprintln!("skipped: this file system has no room for {length} zeros");
        return;
    }
    fails(&folder, &["merge", "large.film", "-o", "x.png"], &["large.film", "4398046511104 bytes"]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Bytes changed, added, removed, with the checksum made to fit: an error, or another film, never a panic.
    #[test]
    fn forgeries_do_no_harm(
        edits in proptest::collection::vec((0.0..1.0f64, 0u8..4, any::<u8>()), 1..6),
        keep in 0.0..1.3f64,
    ) {
        let mut bytes = encode(&made_up(UVec2::new(18, 3), Some(0..6), |tile| Ranges::from(0..4 + tile as u32)));
        for (at, what, value) in edits {
            let at = 12 + (at * (bytes.len() - 12) as f64) as usize;
            match what {
                0 => bytes[at] = value,
                1 => bytes.insert(at, value),
                2 => { bytes.remove(at); }
                _ => bytes[at] = 0xff,
            }
        }
        if keep < 1.0 {
            bytes.truncate((keep * bytes.len() as f64) as usize);
        }
        match decode(&forged(bytes)) {
            Err(error) => prop_assert!(error.to_string().starts_with("some.film: ")),
            Ok(file) => {
                // What is taken for a film can be used as one.
                let mut sum = file.film.clone();
                sum.merge(&file.film);
                prop_assert!(penumbra::image::files::linear_pixels(&sum).iter().all(|p| p.is_finite()));
            }
        }
    }

    #[test]
    fn any_bytes_are_a_film_or_none(bytes: Vec<u8>) {
        prop_assert!(decode(&bytes).is_err());
        let headed = [b"\x89PenFilm\x01\0\0\0".as_slice(), &bytes].concat();
        prop_assert!(decode(&forged(headed)).is_err());
    }
}
