//! Numbers and indices as OBJ files spell them.

/// Stands for "no index given".
pub(super) const NONE: u32 = u32::MAX;

/// Up to `N` numbers; how many there were. Values that are not finite are allowed, here.
pub(super) fn numbers<const N: usize>(text: &str) -> Result<([f64; N], usize), String> {
    let mut values = [0.0; N];
    let mut count = 0;
    for word in text.split_ascii_whitespace().take_while(|word| !word.starts_with('#')).take(N) {
        values[count] = number(word).ok_or_else(|| {
            let way_out = if word.contains(',') {
                ": a comma instead of a point or blank? Export it again so"
            } else {
                ""
            };
            format!("`{}` is not a number{way_out}", shorten(word))
        })?;
        count += 1;
    }
    Ok((values, count))
}

/// A number. What is spelled as not finite (`nan`, `inf`, `1.#IND` of old compilers) is NaN; what is
/// too large is infinite.
fn number(word: &str) -> Option<f64> {
    let old = word.contains(".#IN") || word.contains(".#QNAN") || word.contains(".#SNAN");
    if old {
        return Some(f64::NAN);
    }
    let lower = || word.trim_start_matches(['+', '-']).to_ascii_lowercase();
    // Fortran writes the exponents of double precision so.
    let parsed = word.parse::<f64>().ok().or_else(|| word.replace(['d', 'D'], "e").parse().ok());
    let Some(value) = parsed else {
        return (lower().starts_with("nan") || lower().starts_with("inf")).then_some(f64::NAN);
    };
    let is_spelled = !value.is_finite() && !word.contains(|c: char| c.is_ascii_digit());
    Some(if is_spelled { f64::NAN } else { value })
}

/// Index from 0 of what a face names from 1, or from the end if negative.
pub(super) fn resolve(word: Option<&str>, count: usize, what: &str) -> Result<u32, String> {
    let word = word.unwrap_or_default();
    if word.is_empty() {
        return Ok(NONE);
    }
    let out_of_range = || format!("index out of range: {what} {}, {count} so far", shorten(word));
    match word.parse::<i64>() {
        Ok(0) => Err(format!("index 0: {what} indices begin at 1")),
        Ok(index) if index > 0 => {
            u32::try_from(index - 1).ok().filter(|&i| i != NONE).ok_or_else(out_of_range)
        }
        Ok(index) => {
            let from_end =
                usize::try_from(index.unsigned_abs()).ok().and_then(|back| count.checked_sub(back));
            from_end.and_then(|i| u32::try_from(i).ok()).ok_or_else(out_of_range)
        }
        // Some write whole numbers as `1.0`.
        Err(error) => match word.split_once('.') {
            Some((whole, "0" | "00" | "000" | "000000")) => resolve(Some(whole), count, what),
            _ => Err(format!("{what} index `{}` is not a number in range: {error}", shorten(word))),
        },
    }
}

pub(super) fn shorten(word: &str) -> String {
    word.chars().take(40).collect()
}

/// Groups of four bytes in hexadecimal digits, one behind the other.
pub(super) fn bytes_of(text: &str) -> impl Iterator<Item = [u8; 4]> {
    let (digits, _) = text.trim_end().as_bytes().as_chunks::<8>();
    digits.iter().map_while(|group| {
        let value = u32::from_str_radix(str::from_utf8(group).ok()?, 16).ok()?;
        Some(value.to_be_bytes())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_fortran_are_numbers_and_those_with_commas_are_not() {
        assert_eq!(number("-1.5D+2"), Some(-150.0));
        assert_eq!(number("1.0d0"), Some(1.0));
        assert_eq!((number("1,0"), number("1,"), number("d"), number("D0")), (None, None, None, None));
        assert!(numbers::<3>("1,0 2,0 3,0").is_err_and(|why| why.contains("a comma instead of a point")));
    }

    #[test]
    fn whole_numbers_with_a_point_are_indices() {
        assert_eq!(resolve(Some("2.0"), 4, "vertex"), Ok(1));
        assert_eq!(resolve(Some("-1.000000"), 4, "vertex"), Ok(3));
        assert!(resolve(Some("2.5"), 4, "vertex").is_err());
        assert!(resolve(Some("0.0"), 4, "vertex").is_err());
    }
}
