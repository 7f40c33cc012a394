//! Statements of an MTL library, checked one by one: `tobj` panics on a colour of two numbers, and one bad statement would lose
//! the whole library.

use super::lines::{self, Statement, before_comment, unquoted};
use super::map;
use crate::load::report::Sink;
use std::fmt::Write;

/// Statements of a colour.
const COLORS: [&str; 5] = ["Ka", "Kd", "Ks", "Ke", "Tf"];
/// Statements of one number.
const SCALARS: [&str; 11] = ["Ns", "Ni", "d", "Tr", "Pr", "Pm", "Ps", "Pc", "Pcr", "aniso", "anisor"];
/// Statements that name a picture.
const MAPS: [&str; 9] =
    ["map_Kd", "map_d", "map_Ke", "map_Ks", "map_Ns", "map_Pr", "map_Pm", "map_Bump", "norm"];
/// The others that are known.
const OTHERS: [&str; 7] = ["newmtl", "illum", "bump", "map_Ka", "disp", "decal", "refl"];

/// How the number of a material begins that has no name, and serves as one.
pub(super) const NAMELESS: &str = "(material ";
/// Options of pictures that change them, and are not followed.
const UNFOLLOWED: [&str; 3] = ["-t", "-cc", "-boost"];

/// Only statements that `tobj` parses, in its spelling; warns of the others.
pub(super) fn tidy(library: &str, text: &str, by_blender: bool, sink: &mut Sink<'_>) -> String {
    let mut tidied = String::with_capacity(text.len());
    let (mut inside, mut number) = (false, 0);
    let done: Result<(), std::fmt::Error> = lines::for_each(text, |Statement { line, keyword, rest }| {
        let mut ignore = |what: &str| {
            sink.ignored(library, &format!("line {line}"), format!("`{keyword}` {what}"));
            Ok(())
        };
        let mut known = COLORS.iter().chain(&SCALARS).chain(&MAPS).chain(&OTHERS);
        let keyword = known.find(|known| known.eq_ignore_ascii_case(keyword)).copied().unwrap_or(keyword);
        if keyword == "newmtl" {
            let name = unquoted(rest);
            (inside, number) = (true, number + 1);
            if !name.is_empty() {
                return writeln!(tidied, "newmtl {name}");
            }
            let name = format!("{NAMELESS}{number})");
            sink.repaired(
                library,
                &format!("line {line}"),
                format!("`newmtl` without a name: called `{name}`"),
            );
            return writeln!(tidied, "newmtl {name}");
        }
        if !inside {
            return ignore("before the first newmtl, ignored");
        }
        let values: Option<Vec<f32>> = before_comment(rest)
            .split_ascii_whitespace()
            .map(|word| word.parse().ok().filter(|v: &f32| v.is_finite()))
            .collect();
        let keyword = match keyword {
            "bump" => "map_Bump",
            "map_refl" if by_blender => "map_Pm",
            "map_opacity" => "map_d",
            _ => keyword,
        };
        match (keyword, values.as_deref()) {
            (color, Some([r, g, b, ..])) if COLORS.contains(&color) => {
                writeln!(tidied, "{color} {r} {g} {b}")
            }
            (color, Some([grey])) if COLORS.contains(&color) => {
                writeln!(tidied, "{color} {grey} {grey} {grey}")
            }
            (color, _) if COLORS.contains(&color) => ignore("without three numbers, ignored"),
            ("d", _) if rest.starts_with("-halo") => ignore("-halo is not supported, ignored"),
            (scalar, Some([value, ..])) if SCALARS.contains(&scalar) => writeln!(tidied, "{scalar} {value}"),
            (scalar, _) if SCALARS.contains(&scalar) => ignore("without a number, ignored"),
            ("illum", Some([model, ..])) if (0.0..=10.0).contains(model) => {
                writeln!(tidied, "illum {}", *model as u8)
            }
            ("illum", _) => ignore("with an unknown model, ignored"),
            (map, _) if MAPS.contains(&map) => {
                if rest.is_empty() {
                    ignore("without a file name, ignored")
                } else {
                    let statement = map::options_first(rest);
                    let options = statement.trim_end().strip_suffix(map::Map::parse(&statement).name);
                    let words = options.unwrap_or_default().split_ascii_whitespace();
                    for option in words.filter(|word| UNFOLLOWED.contains(word)) {
                        let what =
                            format!("option `{option}` of `{map}` is not supported: as if it were not there");
                        sink.approximated(library, &format!("line {line}"), what);
                    }
                    writeln!(tidied, "{map} {}", map::beside(library, &statement))
                }
            }
            ("disp" | "decal" | "refl", _) => {
                let what = format!("`{keyword}` textures are not supported");
                sink.ignored(library, &format!("line {line}"), what);
                Ok(())
            }
            // The ambient colour of a lighting model without other light: told where no other picture is there.
            ("map_Ka", _) => writeln!(tidied, "map_Ka {}", if rest.is_empty() { "-" } else { rest }),
            _ => ignore("is not supported"),
        }
    });
    // Writing to a String cannot fail.
    debug_assert!(done.is_ok());
    tidied
}
