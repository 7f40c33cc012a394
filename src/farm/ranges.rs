//! Sets of sample indices.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;

/// A set of sample indices as ranges: sorted, none empty, no two touching.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ranges(Vec<Range<u32>>);

impl From<Range<u32>> for Ranges {
    fn from(range: Range<u32>) -> Self {
        Self(if range.is_empty() { Vec::new() } else { vec![range] })
    }
}

impl Ranges {
    /// From ranges as a file has them; `None` unless they are sorted, not empty and apart.
    #[must_use]
    pub fn checked(ranges: Vec<Range<u32>>) -> Option<Self> {
        let sound = ranges.iter().all(|r| !r.is_empty()) && ranges.windows(2).all(|w| w[0].end < w[1].start);
        sound.then_some(Self(ranges))
    }

    /// The ranges, in order.
    #[must_use]
    pub fn as_slice(&self) -> &[Range<u32>] {
        &self.0
    }

    /// From the first index to the last, with whatever is missing between; `None` if there is none.
    #[must_use]
    pub fn hull(&self) -> Option<Range<u32>> {
        Some(self.0.first()?.start..self.0.last()?.end)
    }

    /// How many indices there are.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.0.iter().map(|r| r.end - r.start).sum()
    }

    /// How many of them are even, and how many odd: the halves of the film.
    #[must_use]
    pub fn halves(&self) -> [u32; 2] {
        // Below an end e there are ⌈e/2⌉ even numbers and ⌊e/2⌋ odd ones.
        let below = |end: u32| [end.div_ceil(2), end / 2];
        self.0.iter().fold([0, 0], |sum, range| {
            let (upper, lower) = (below(range.end), below(range.start));
            [0, 1].map(|half| sum[half] + upper[half] - lower[half])
        })
    }

    /// The first stretch that both have.
    #[must_use]
    pub fn overlap(&self, other: &Self) -> Option<Range<u32>> {
        let common = |a: &Range<u32>, b: &Range<u32>| a.start.max(b.start)..a.end.min(b.end);
        self.0.iter().flat_map(|a| other.0.iter().map(move |b| common(a, b))).find(|r| !r.is_empty())
    }

    /// Adds what `other` has.
    pub fn unite(&mut self, other: &Self) {
        let mut all = std::mem::take(&mut self.0);
        all.extend_from_slice(&other.0);
        all.sort_unstable_by_key(|range| range.start);
        for range in all {
            match self.0.last_mut() {
                Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
                _ => self.0.push(range),
            }
        }
    }

    /// What of `wanted` is not there.
    #[must_use]
    pub fn missing(&self, wanted: Range<u32>) -> Self {
        let mut from = wanted.start;
        let mut gaps = Vec::new();
        for range in &self.0 {
            if range.start > from {
                gaps.push(from..range.start.min(wanted.end));
            }
            from = from.max(range.end);
        }
        gaps.push(from..wanted.end);
        gaps.retain(|gap| !gap.is_empty());
        Self(gaps)
    }
}

/// `0..16, 32..48`
impl fmt::Display for Ranges {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.write_str("none");
        }
        for (i, range) in self.0.iter().enumerate() {
            let comma = if i == 0 { "" } else { ", " };
            write!(f, "{comma}{}..{}", range.start, range.end)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn indices(ranges: &Ranges) -> BTreeSet<u32> {
        ranges.as_slice().iter().cloned().flatten().collect()
    }

    fn some_ranges() -> impl Strategy<Value = Ranges> {
        proptest::collection::vec((0u32..60, 0u32..12), 0..6).prop_map(|list| {
            let mut ranges = Ranges::default();
            for (start, length) in list {
                ranges.unite(&Ranges::from(start..start + length));
            }
            ranges
        })
    }

    proptest! {
        #[test]
        fn ranges_are_sets(a in some_ranges(), b in some_ranges(), from in 0u32..40, length in 0u32..40) {
            let (set_a, set_b) = (indices(&a), indices(&b));
            prop_assert_eq!(Ranges::checked(a.0.clone()), Some(a.clone()), "always in order");
            let mut both = a.clone();
            both.unite(&b);
            prop_assert_eq!(indices(&both), &set_a | &set_b);
            let first = set_a.intersection(&set_b).next().copied();
            prop_assert_eq!(a.overlap(&b).map(|r| r.start), first);
            let wanted: BTreeSet<u32> = (from..from + length).collect();
            prop_assert_eq!(indices(&a.missing(from..from + length)), &wanted - &set_a);
            let odd = set_a.iter().filter(|&i| i % 2 == 1).count() as u32;
            prop_assert_eq!(a.halves(), [a.count() - odd, odd]);
            prop_assert_eq!(a.count() as usize, set_a.len());
        }
    }

    #[test]
    fn what_is_not_in_order_is_no_set() {
        let empty = Range { start: 3, end: 3 };
        for wrong in [vec![2..4, 4..6], vec![5..6, 1..2], vec![empty], vec![1..5, 2..3]] {
            assert_eq!(Ranges::checked(wrong.clone()), None, "{wrong:?}");
        }
    }
}
