//! Many rays in batches, on all threads.

use crate::torture::Trial;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Rays of a batch.
pub const BATCH: u64 = 1024;

/// What is being counted: for the display of progress.
pub struct Counting<'a> {
    /// By whom.
    pub trial: &'a Trial<'a>,
    /// Which case.
    pub id: &'static str,
    /// Mesh and place.
    pub what: &'a str,
    /// How much of the case is done before and after, 0 to 1.
    pub part: [f64; 2],
    /// Rays of one batch.
    pub batch: u64,
}

impl Counting<'_> {
    /// Gives `batch` numbers until there are `count` rays, and sums up what it counts, item by item. Returns how
    /// many rays there were, and the sums.
    pub fn sum(&self, count: u64, items: usize, batch: impl Fn(u64) -> Vec<u64> + Sync) -> (u64, Vec<u64>) {
        let batches = count.div_ceil(self.batch);
        let done = AtomicU64::new(0);
        let [from, to] = self.part;
        self.trial.tell(self.id, self.what, from);
        let sums = (0..batches)
            .into_par_iter()
            .filter(|_| !self.trial.interrupted())
            .map(|number| {
                let counts = batch(number);
                let now = done.fetch_add(1, Ordering::Relaxed) + 1;
                if now.is_multiple_of(256) {
                    let part = from + (to - from) * now as f64 / batches as f64;
                    self.trial.tell(self.id, self.what, part);
                }
                counts
            })
            .reduce(
                || vec![0; items],
                |mut sums, counts| {
                    sums.iter_mut().zip(&counts).for_each(|(sum, count)| *sum += count);
                    sums
                },
            );
        (done.into_inner() * self.batch, sums)
    }
}
