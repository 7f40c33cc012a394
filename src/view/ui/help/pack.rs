//! Sections into columns.

use std::ops::Range;

/// A section, and which of its rows.
pub(super) type Part = (usize, Range<usize>);

/// Sections of rows of these heights, in order in columns of at most `height`. One stays whole where a column has room for all
/// of it; else it goes on in the next, with its heading. A column has one row at least.
pub(super) fn packed(sections: &[Vec<f32>], heading: f32, height: f32) -> Vec<Vec<Part>> {
    let mut columns: Vec<Vec<Part>> = vec![Vec::new()];
    let mut left = height;
    for (section, rows) in sections.iter().enumerate() {
        let whole = heading + rows.iter().sum::<f32>();
        if whole > left && whole <= height {
            columns.push(Vec::new());
            left = height;
        }
        let mut next = 0;
        while next < rows.len() {
            let is_empty = columns.last().is_none_or(Vec::is_empty);
            let mut used = heading;
            let fitting = rows[next..].iter().take_while(|&&row| {
                used += row;
                used <= left
            });
            let count = fitting.count().max(usize::from(is_empty));
            // A heading with a single row below it looks lost.
            if count == 0 || count == 1 && !is_empty && rows.len() - next > 1 {
                columns.push(Vec::new());
                left = height;
                continue;
            }
            left -= heading + rows[next..next + count].iter().sum::<f32>();
            if let Some(column) = columns.last_mut() {
                column.push((section, next..next + count));
            }
            next += count;
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_have_all_rows_once_and_are_no_longer_than_they_may_be() {
        let sections = [vec![1.0; 6], vec![1.0; 11], vec![2.0; 4], vec![1.0; 1]];
        for height in [0.0, 1.0, 3.0, 7.0, 13.0, 20.0, 1000.0] {
            let columns = packed(&sections, 2.0, height);
            let rows = columns
                .iter()
                .flatten()
                .flat_map(|(section, rows)| rows.clone().map(move |row| (*section, row)));
            let all =
                sections.iter().enumerate().flat_map(|(s, rows)| (0..rows.len()).map(move |row| (s, row)));
            assert!(rows.eq(all), "{height}");
            for column in &columns {
                let of = |(s, rows): &Part| 2.0 + sections[*s][rows.clone()].iter().sum::<f32>();
                let sum: f32 = column.iter().map(of).sum();
                assert!(sum <= height || column.len() == 1 && column[0].1.len() == 1, "{height}: {column:?}");
            }
        }
    }

    #[test]
    fn a_section_that_fits_is_not_torn() {
        let columns = packed(&[vec![1.0; 6], vec![1.0; 6]], 1.0, 10.0);
        assert_eq!(columns, [[(0, 0..6)], [(1, 0..6)]]);
        let columns = packed(&[vec![1.0; 2], vec![1.0; 12]], 1.0, 10.0);
        assert_eq!(columns, [vec![(0, 0..2), (1, 0..6)], vec![(1, 6..12)]]);
    }
}
