//! `map_` statements of MTL libraries: their options.

use crate::scene::color::luminance;
use crate::scene::{Texels, TextureUse, Wrap};
use bevy_ecs::prelude::*;
use glam::{Affine2, Vec2, Vec3};
use std::sync::Arc;

/// The options, and how many words follow them.
fn arguments_of(option: &str) -> Option<usize> {
    match option {
        "-mm" => Some(2),
        "-s" | "-o" | "-t" => Some(3),
        "-blendu" | "-blendv" | "-boost" | "-bm" | "-cc" | "-clamp" | "-colorspace" | "-imfchan"
        | "-texres" | "-type" => Some(1),
        _ => None,
    }
}

/// The statement with options that some programs write behind the name where they belong, before it.
pub(super) fn options_first(statement: &str) -> String {
    let is_option = |(at, _): &(usize, &str)| {
        let option = statement[at + 1..].split_ascii_whitespace().next().unwrap_or_default();
        // A name has an ending; what comes before is arguments.
        let name = statement[..*at].split_ascii_whitespace().next_back().unwrap_or_default();
        let has_ending =
            name.rsplit_once('.').is_some_and(|(_, ending)| ending.starts_with(char::is_alphabetic));
        arguments_of(option).is_some() && has_ending
    };
    match statement.match_indices(" -").find(is_option) {
        Some((at, _)) => format!("{} {}", &statement[at + 1..], &statement[..at]),
        None => statement.to_owned(),
    }
}

/// A texture statement: options, then a file name that may have spaces.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map<'a> {
    pub name: &'a str,
    scale: Vec2,
    offset: Vec2,
    pub clamp: bool,
    /// `-bm`.
    pub bump: f32,
    /// `-imfchan`: the channel that counts, of those that are one number.
    channel: Option<char>,
    /// `-mm`: what is added to the picture's values, and what they are multiplied by before.
    range: Vec2,
}

impl<'a> Map<'a> {
    pub fn parse(statement: &'a str) -> Self {
        let mut map = Self {
            name: statement.trim(),
            scale: Vec2::ONE,
            offset: Vec2::ZERO,
            clamp: false,
            bump: 1.0,
            channel: None,
            range: Vec2::Y,
        };
        while let Some(option) = map.name.strip_prefix('-').and_then(|_| first_word(map.name)) {
            let Some(arguments) = arguments_of(option) else { break };
            let mut rest = map.name[option.len()..].trim_start();
            let mut vector = match option {
                "-s" => Vec2::ONE,
                _ => Vec2::ZERO,
            };
            let mut all_numbers = true;
            for i in 0..arguments {
                let Some(word) = first_word(rest) else { break };
                let value = word.parse::<f32>().ok().filter(|value| value.is_finite());
                if arguments == 3 && value.is_none() {
                    break;
                }
                all_numbers &= value.is_some();
                if i < 2 {
                    vector[i] = value.unwrap_or(0.0);
                }
                if option == "-bm" {
                    map.bump = value.unwrap_or(1.0);
                }
                if option == "-imfchan" {
                    map.channel = word.chars().next();
                }
                map.clamp |= option == "-clamp" && word == "on";
                rest = rest[word.len()..].trim_start();
            }
            match option {
                "-s" => map.scale = vector,
                "-o" => map.offset = vector,
                "-mm" if all_numbers => map.range = vector,
                _ => {}
            }
            map.name = rest;
        }
        map
    }

    /// What it takes of its picture.
    pub fn source(&self) -> String {
        if self.is_plain() {
            return self.name.to_owned();
        }
        format!("{:?} {} {}", self.channel, self.range, self.name)
    }

    pub fn is_plain(&self) -> bool {
        self.channel.is_none() && self.range == Vec2::Y
    }

    /// What the options make of a picture.
    pub fn of(&self, picture: &Arc<Texels>) -> Arc<Texels> {
        if self.is_plain() {
            return Arc::clone(picture);
        }
        let moved = |byte: u8| (f32::from(byte) * self.range.y + self.range.x * 255.0).round() as u8;
        let texel = |&[r, g, b, a]: &[u8; 4]| {
            let [r, g, b] = [r, g, b].map(moved);
            match self.channel {
                Some('r') => [r, r, r, 255],
                Some('g') => [g, g, g, 255],
                Some('b') => [b, b, b, 255],
                Some('m') => [moved(a), moved(a), moved(a), 255],
                Some('l') => {
                    let grey = luminance(Vec3::new(r.into(), g.into(), b.into())).round() as u8;
                    [grey, grey, grey, 255]
                }
                _ => [r, g, b, a],
            }
        };
        Arc::new(Texels { texels: picture.texels.iter().map(texel).collect(), ..**picture })
    }

    /// What the options make of the brightness of a picture, from 0 to 1; none if they ask for one channel.
    pub fn of_brightness(&self, brightness: &[u16]) -> Option<Vec<f32>> {
        let moved = |&b: &u16| (f32::from(b) / 65535.0 * self.range.y + self.range.x).clamp(0.0, 1.0);
        self.channel.is_none().then(|| brightness.iter().map(moved).collect())
    }

    /// Whether it puts its picture where another one puts its own.
    pub fn lies_as(&self, other: &Self) -> bool {
        (self.scale, self.offset, self.clamp) == (other.scale, other.offset, other.clamp)
    }

    /// In coordinates with v down: the mesh's are turned already.
    fn uv_transform(&self) -> Affine2 {
        let offset = Vec2::new(self.offset.x, 1.0 - self.scale.y - self.offset.y);
        Affine2::from_scale_angle_translation(self.scale, 0.0, offset)
    }

    pub fn used(&self, texture: Entity) -> TextureUse {
        TextureUse { texture, uv_transform: self.uv_transform(), second_uvs: false }
    }

    pub fn wrap(&self) -> [Wrap; 2] {
        [if self.clamp { Wrap::Clamp } else { Wrap::Repeat }; 2]
    }
}

fn first_word(text: &str) -> Option<&str> {
    text.split_ascii_whitespace().next()
}

/// What stands between the folder of a library and the name that it gives: no file has it in its text.
pub(super) const BESIDE: &str = "\0";

/// The same statement as the scene's folder sees it: names in a library count from the library's folder.
pub(super) fn beside(library: &str, statement: &str) -> String {
    let Some((folder, _)) = library.rsplit_once(['/', '\\']) else { return statement.to_owned() };
    let name = Map::parse(statement).name;
    let options = statement.trim_end().strip_suffix(name).unwrap_or_default();
    format!("{options}{folder}{BESIDE}{name}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texture_options_come_before_a_name_with_spaces() {
        let map = Map::parse("-blendu on -s 2 3 1 -o 0.5 0 -mm 0 1 -clamp on my tex.png");
        assert_eq!(
            map,
            Map {
                name: "my tex.png",
                scale: Vec2::new(2., 3.),
                offset: Vec2::new(0.5, 0.),
                clamp: true,
                bump: 1.0,
                channel: None,
                range: Vec2::Y,
            }
        );
        assert_eq!(Map::parse("-odd name.png").name, "-odd name.png");
        let map = Map::parse("-imfchan g -mm 0.5 0.25 \"a.png\"");
        assert_eq!((map.name, map.channel, map.range), ("\"a.png\"", Some('g'), Vec2::new(0.5, 0.25)));
        let picture = Arc::new(Texels { width: 1, height: 1, texels: vec![[0, 100, 200, 9]] });
        assert_eq!(map.of(&picture).texels, [[153, 153, 153, 255]]);
        assert_eq!(Map::parse("a.png").of(&picture).texels, picture.texels);
        assert_eq!(Map::parse("-mm a b a.png").of(&picture).texels, picture.texels);
    }

    #[test]
    fn offset_and_scale_count_from_the_bottom_left() {
        let map = Map::parse("-s 2 2 -o 0.25 0.5 x.png");
        // v = 0.1 from the bottom is 0.9 from the top; 0.1 * 2 + 0.5 = 0.7 from the bottom is 0.3 from the top.
        let moved = map.uv_transform().transform_point2(Vec2::new(0.1, 0.9));
        assert!((moved - Vec2::new(0.45, 0.3)).length() < 1e-6);
    }
}
