//! Changes of a file: bytes, numbers, words.

use proptest::prelude::*;

/// One change. Places are fractions of the file, so that they make sense for every file.
#[derive(Clone, Debug)]
pub enum Mutation {
    /// Sets one byte.
    Byte(f64, u8),
    /// Turns one bit.
    Bit(f64, u8),
    /// Takes bytes out.
    Cut(f64, u16),
    /// Repeats bytes after themselves.
    Repeat(f64, u16),
    /// Copies bytes over others.
    Copy(f64, f64, u16),
    /// Ends the file there.
    End(f64),
    /// Writes another number over one of a text's (indices, counts, factors ...).
    Number(f64, usize),
    /// Writes one of the text's numbers over another.
    Same(f64, f64),
    /// Four bytes, as binary numbers are stored.
    Word(f64, u32),
}

/// What numbers become.
pub const NUMBERS: [&str; 26] = [
    "0",
    "0",
    "1",
    "0.5",
    "3",
    "1",
    "2",
    "-1",
    "3.5",
    "65535",
    "65536",
    "16777216",
    "2147483647",
    "2147483648",
    "4294967295",
    "4294967296",
    "9007199254740993",
    "18446744073709551615",
    "1e30",
    "-1e30",
    "1e400",
    "1e-45",
    "null",
    "\"x\"",
    "[]",
    "nan",
];

/// Which sample, and one to three changes of it.
pub fn mutations(samples: usize) -> impl Strategy<Value = (usize, Vec<Mutation>)> {
    let place = || 0.0..1.0_f64;
    let words = prop_oneof![any::<u32>(), Just(0), Just(u32::MAX), Just(0x7fc0_0000), Just(0x7f80_0000)];
    let one = prop_oneof![
        1 => (place(), any::<u8>()).prop_map(|(at, byte)| Mutation::Byte(at, byte)),
        1 => (place(), 0..8_u8).prop_map(|(at, bit)| Mutation::Bit(at, bit)),
        1 => (place(), 1..64_u16).prop_map(|(at, length)| Mutation::Cut(at, length)),
        1 => (place(), 1..200_u16).prop_map(|(at, length)| Mutation::Repeat(at, length)),
        1 => (place(), place(), 1..64_u16).prop_map(|(from, to, length)| Mutation::Copy(from, to, length)),
        1 => place().prop_map(Mutation::End),
        20 => (place(), 0..NUMBERS.len()).prop_map(|(at, number)| Mutation::Number(at, number)),
        12 => (place(), place()).prop_map(|(from, to)| Mutation::Same(from, to)),
        2 => (place(), words).prop_map(|(at, word)| Mutation::Word(at, word)),
    ];
    (0..samples, prop::collection::vec(one, 1..=3))
}

/// The file with all changes, one after the other.
pub fn apply(bytes: &[u8], mutations: &[Mutation]) -> Vec<u8> {
    mutations
        .iter()
        .fold(bytes.to_vec(), |bytes, mutation| glb_mended(bytes, |bytes| change(bytes, mutation)))
}

/// In a GLB, half of the changes go to the JSON chunk, and the lengths are made right again, so that they come
/// farther than its header.
fn glb_mended(bytes: Vec<u8>, change: impl FnOnce(Vec<u8>) -> Vec<u8>) -> Vec<u8> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes(b.try_into().unwrap()) as usize);
    let json_end = word(12).map(|length| 20 + length).filter(|&end| end <= bytes.len());
    let Some(json_end) = json_end.filter(|_| bytes.starts_with(b"glTF") && bytes.len().is_multiple_of(2))
    else {
        return change(bytes);
    };
    let rest = bytes[json_end..].to_vec();
    let mut json = change(bytes[20..json_end].to_vec());
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut whole = b"glTF\x02\0\0\0".to_vec();
    whole.extend(((20 + json.len() + rest.len()) as u32).to_le_bytes());
    whole.extend((json.len() as u32).to_le_bytes());
    whole.extend(b"JSON");
    whole.extend(json);
    whole.extend(rest);
    whole
}

fn change(mut bytes: Vec<u8>, mutation: &Mutation) -> Vec<u8> {
    let length = bytes.len();
    if length == 0 {
        return bytes;
    }
    let at = |place: f64| ((place * length as f64) as usize).min(length - 1);
    let range = |place: f64, count: u16| at(place)..(at(place) + usize::from(count)).min(length);
    match *mutation {
        Mutation::Byte(place, byte) => bytes[at(place)] = byte,
        Mutation::Bit(place, bit) => bytes[at(place)] ^= 1 << bit,
        Mutation::Cut(place, count) => drop(bytes.drain(range(place, count))),
        Mutation::Repeat(place, count) => {
            let part = bytes[range(place, count)].to_vec();
            bytes.splice(at(place)..at(place), part);
        }
        Mutation::Copy(from, to, count) => {
            let part = bytes[range(from, count)].to_vec();
            let end = (at(to) + part.len()).min(length);
            bytes.splice(at(to)..end, part);
        }
        Mutation::End(place) => bytes.truncate(at(place)),
        Mutation::Number(place, number) => {
            if let Some(old) = number_near(&bytes, at(place)) {
                bytes.splice(old, NUMBERS[number].bytes());
            }
        }
        Mutation::Same(from, to) => {
            if let (Some(from), Some(to)) = (number_near(&bytes, at(from)), number_near(&bytes, at(to))) {
                let part = bytes[from].to_vec();
                bytes.splice(to, part);
            }
        }
        Mutation::Word(place, word) => {
            let at = at(place) / 4 * 4;
            for (byte, new) in bytes[at..].iter_mut().zip(word.to_le_bytes()) {
                *byte = new;
            }
        }
    }
    bytes
}

/// The first number of a text from there on, but not inside of a string.
fn number_near(bytes: &[u8], at: usize) -> Option<std::ops::Range<usize>> {
    let is_digit = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
    let starts = |i: &usize| bytes[*i].is_ascii_digit() && *i > 0 && b" :,[\n\t/".contains(&bytes[*i - 1]);
    let start = (at..bytes.len()).chain(0..at).find(starts)?;
    let end = bytes[start..].iter().position(|byte| !is_digit(byte)).map_or(bytes.len(), |n| start + n);
    Some(start..end)
}
