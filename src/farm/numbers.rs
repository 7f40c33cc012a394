//! Numbers as a film file writes them: few bytes for what is small, or has zeros at either end.

/// Bytes being read from the front.
#[derive(Clone, Copy, Debug)]
pub struct Reader<'a>(pub &'a [u8]);

impl<'a> Reader<'a> {
    /// The next `count` bytes, if there are so many.
    pub fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|b| b[0])
    }

    /// What [`write_count`] wrote; `None` if the bytes end, or it is more than a u64.
    pub fn count(&mut self) -> Option<u64> {
        let mut value = 0u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            let bits = u64::from(byte & 0x7f);
            // The tenth byte has room for one bit.
            if shift == 63 && bits > 1 {
                return None;
            }
            value |= bits << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// What [`write_sum`] wrote; `None` if the bytes end or make no sense.
    pub fn sum(&mut self) -> Option<i128> {
        let head = self.byte()?;
        if head == ZERO {
            return Some(0);
        }
        let (offset, length) = (usize::from(head >> 4), usize::from(head & 15) + 1);
        let end = offset + length;
        if end > 16 {
            return None;
        }
        let digits = self.take(length)?;
        let negative = digits[length - 1] & 0x80 != 0;
        let mut bytes = [0; 16];
        bytes[offset..end].copy_from_slice(digits);
        if negative {
            bytes[end..].fill(0xff);
        }
        Some(i128::from_le_bytes(bytes))
    }
}

/// LEB128: seven bits a byte, lowest first, the top bit where more follow.
pub fn write_count(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Head of a sum that is zero; no other number has it.
const ZERO: u8 = 0xff;

/// Two's complement, lowest byte first, without the zero bytes below and the copies of the sign above.
/// Before them a byte: how many zero bytes were left out, times 16, plus how many bytes follow, minus 1.
pub fn write_sum(out: &mut Vec<u8>, value: i128) {
    if value == 0 {
        out.push(ZERO);
        return;
    }
    let bytes = value.to_le_bytes();
    let first = (value.trailing_zeros() / 8) as usize;
    // One bit more than the magnitude has: the sign.
    let magnitude = if value < 0 { !value } else { value };
    let last = ((128 - magnitude.leading_zeros()) / 8) as usize;
    out.push((first << 4 | (last - first)) as u8);
    out.extend_from_slice(&bytes[first..=last]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn there_and_back(value: i128) -> usize {
        let mut bytes = Vec::new();
        write_sum(&mut bytes, value);
        let length = bytes.len();
        bytes.push(0x5a);
        let mut reader = Reader(&bytes);
        assert_eq!(reader.sum(), Some(value));
        assert_eq!(reader.0, [0x5a], "reads just its own: {value}");
        assert_eq!(Reader(&bytes[..length - 1]).sum(), None, "{value} cut short");
        length
    }

    #[test]
    fn sums_of_all_sizes_come_back() {
        assert_eq!(there_and_back(0), 1);
        for shift in 0..127 {
            for base in [1, -1, 3, -3, 0x7f, -0x80, 0x80, 0xff, -0xff] {
                if let Some(value) = i128::checked_mul(base, 1 << shift) {
                    there_and_back(value);
                    there_and_back(value ^ 1);
                }
            }
        }
        there_and_back(i128::MAX);
        there_and_back(i128::MIN);
        // A sum of four samples around a half.
        assert!(there_and_back((1 << 61) + (1 << 40)) <= 5);
    }

    proptest! {
        #[test]
        fn numbers_come_back(high: i64, low: u64, shift in 0u32..127, count: u64) {
            there_and_back((i128::from(high) << 64 | i128::from(low)) >> shift);
            let mut bytes = Vec::new();
            write_count(&mut bytes, count >> (shift % 64));
            prop_assert_eq!(Reader(&bytes).count(), Some(count >> (shift % 64)));
            prop_assert_eq!(Reader(&bytes[..bytes.len() - 1]).count(), None);
        }

        #[test]
        fn any_bytes_are_a_number_or_none(bytes: Vec<u8>) {
            let _ = (Reader(&bytes).count(), Reader(&bytes).sum());
        }
    }
}
