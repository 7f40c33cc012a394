//! Values on the command line, as people write them.

use crate::bvh::Isa;
use glam::{DVec3, UVec2};
use std::ops::Range;
use std::time::Duration;

pub(super) fn isa(text: &str) -> Result<Isa, String> {
    Isa::named(text).ok_or_else(|| {
        let names: Vec<&str> = Isa::available().into_iter().map(Isa::name).collect();
        format!("this machine has {}", names.join(", "))
    })
}

pub(super) fn resolution(text: &str) -> Result<UVec2, String> {
    let wrong = || format!("\"{text}\" is not a size such as 1280x720");
    let (width, height) = text.split_once(['x', ',']).ok_or_else(wrong)?;
    let side = |s: &str| s.trim().parse().ok().filter(|n| (1..=65536).contains(n)).ok_or_else(wrong);
    let size = UVec2::new(side(width)?, side(height)?);
    // 112 bytes a pixel: more than this is a slip of the finger.
    if u64::from(size.x) * u64::from(size.y) > 1 << 28 {
        return Err(format!("\"{text}\" has more than 2^28 pixels"));
    }
    Ok(size)
}

/// The first pixel, and the one after the last.
pub(super) fn crop(text: &str) -> Result<[UVec2; 2], String> {
    let wrong = || format!("\"{text}\" is not a part such as 320,200,64,48: X,Y,WIDTH,HEIGHT in pixels");
    let numbers: Vec<u32> =
        text.split([',', 'x']).map(|s| s.trim().parse().map_err(|_| wrong())).collect::<Result<_, _>>()?;
    let [x, y, width, height] = *numbers.as_slice() else { return Err(wrong()) };
    let (Some(right), Some(bottom)) = (x.checked_add(width), y.checked_add(height)) else {
        return Err(wrong());
    };
    if width.min(height) > 0 { Ok([UVec2::new(x, y), UVec2::new(right, bottom)]) } else { Err(wrong()) }
}

pub(super) fn vector(text: &str) -> Result<DVec3, String> {
    let wrong = || format!("\"{text}\" is not a vector such as 1,2.5,-3");
    let numbers: Vec<f64> =
        text.split(',').map(|s| s.trim().parse().map_err(|_| wrong())).collect::<Result<_, _>>()?;
    let [x, y, z] = *numbers.as_slice() else { return Err(wrong()) };
    let vector = DVec3::new(x, y, z);
    if vector.is_finite() { Ok(vector) } else { Err(wrong()) }
}

pub(super) fn view_angle(text: &str) -> Result<f32, String> {
    let degrees = text.parse().map_err(|_| format!("\"{text}\" is not a number"))?;
    if 0.0 < degrees && degrees < 180.0 {
        Ok(degrees)
    } else {
        Err("must lie between 0 and 180 degrees".to_owned())
    }
}

pub(super) fn length(text: &str) -> Result<f32, String> {
    let length: f32 = text.parse().map_err(|_| format!("\"{text}\" is not a number"))?;
    if length > 0.0 && length.is_finite() { Ok(length) } else { Err("must be above 0".to_owned()) }
}

pub(super) fn radius(text: &str) -> Result<f32, String> {
    if text.parse() == Ok(0.0) { Ok(0.0) } else { length(text) }
}

pub(super) fn exposure(text: &str) -> Result<f32, String> {
    let stops: f32 = text.parse().map_err(|_| format!("\"{text}\" is not a number"))?;
    if stops.abs() <= 100.0 { Ok(stops) } else { Err("must lie within -100 to 100 stops".to_owned()) }
}

pub(super) fn seconds(text: &str) -> Result<Duration, String> {
    let number: f64 =
        text.strip_suffix('s').unwrap_or(text).parse().map_err(|_| format!("\"{text}\" is not a number"))?;
    // In less there is time for nothing.
    let seconds = Duration::try_from_secs_f64(number).ok().filter(|&time| time >= Duration::from_millis(1));
    seconds.ok_or_else(|| format!("\"{text}\" is not a time of 0.001 or more, such as 2.5 or 2.5s"))
}

pub(super) fn noise(text: &str) -> Result<f64, String> {
    let (digits, unit) = text.strip_suffix('%').map_or((text, 1.0), |digits| (digits, 0.01));
    let number: f64 = digits.trim().parse().map_err(|_| format!("\"{text}\" is not a number"))?;
    let noise = number * unit;
    if 0.0 < noise && noise <= 1.0 {
        Ok(noise)
    } else {
        Err("must lie above 0 and be at most 1, which is 100%; write 1% or 0.01".to_owned())
    }
}

pub(super) fn sample_range(text: &str) -> Result<Range<u32>, String> {
    let wrong = || format!("\"{text}\" is not a range such as 16..64");
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    let range = start.trim().parse().map_err(|_| wrong())?..end.trim().parse().map_err(|_| wrong())?;
    if range.is_empty() { Err(format!("\"{text}\" holds no sample")) } else { Ok(range) }
}

pub(super) fn time(text: &str) -> Result<f64, String> {
    let seconds: f64 =
        text.strip_suffix('s').unwrap_or(text).parse().map_err(|_| format!("\"{text}\" is not a number"))?;
    if (0.0..=1e9).contains(&seconds) { Ok(seconds) } else { Err("must lie within 0 and 1e9".to_owned()) }
}

pub(super) fn bytes(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit: u64 =
        match text[digits.len()..].to_ascii_uppercase().trim_end_matches("IB").trim_end_matches('B') {
            "" => 1,
            "K" => 1 << 10,
            "M" => 1 << 20,
            "G" => 1 << 30,
            "T" => 1 << 40,
            _ => return Err(format!("\"{text}\" is not a size such as 500M or 2G")),
        };
    let number: u64 = digits.parse().map_err(|_| format!("\"{text}\" is not a size such as 500M or 2G"))?;
    number.checked_mul(unit).ok_or_else(|| format!("\"{text}\" is too large"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_as_people_write_them() {
        assert_eq!(resolution("1280x720"), Ok(UVec2::new(1280, 720)));
        assert_eq!(resolution("7,3"), Ok(UVec2::new(7, 3)));
        assert_eq!(vector("-1, 2.5,3e1"), Ok(DVec3::new(-1.0, 2.5, 30.0)));
        assert_eq!(sample_range("16..64"), Ok(16..64));
        assert_eq!(seconds("1.5s"), Ok(Duration::from_millis(1500)));
        assert_eq!(crop("8, 0,4,300"), Ok([UVec2::new(8, 0), UVec2::new(12, 300)]));
        for wrong in ["8,0,4", "8,0,0,3", "-8,0,4,3", "1,2,3,4,5", "4294967295,0,1,1", ""] {
            assert!(crop(wrong).is_err(), "{wrong}");
        }
        for wrong in ["0", "-1", "0s", "-0.0", "nan", "inf", "1e-9", "1e30", "", "s", "soon"] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
        for wrong in ["0x5", "5", "ax3", "65536x65536"] {
            assert!(resolution(wrong).is_err(), "{wrong}");
        }
        assert_eq!((noise("1%"), noise("0.02"), noise("100 %")), (Ok(0.01), Ok(0.02), Ok(1.0)));
        for wrong in ["0", "-1%", "5", "nan", "inf", "%", "x"] {
            assert!(noise(wrong).is_err(), "{wrong}");
        }
        assert!(vector("1,2").is_err() && vector("1,2,nan").is_err());
        assert!(sample_range("64..16").is_err() && view_angle("180").is_err() && exposure("nan").is_err());
    }

    #[test]
    fn sizes_have_units() {
        assert_eq!(
            ["7", "2k", "500M", "1GiB", "3tb"].map(bytes),
            [Ok(7), Ok(2 << 10), Ok(500 << 20), Ok(1 << 30), Ok(3 << 40)]
        );
        assert!(bytes("lots").is_err() && bytes("-1").is_err() && bytes("99999999T").is_err());
    }
}
