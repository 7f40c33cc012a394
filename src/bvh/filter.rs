//! Which hits count.

use super::Hit;

/// Decides which hits count.
pub trait Accept {
    /// Whether hits in this instance have to be asked about: those of others all count, at no cost.
    fn asks(&self, instance: u32) -> bool;
    /// Whether a hit of ray number `ray` counts.
    fn takes(&self, ray: usize, hit: &Hit) -> bool;
}

/// A function asks about all.
impl<F: Fn(usize, &Hit) -> bool> Accept for F {
    #[inline(always)]
    fn asks(&self, _: u32) -> bool {
        true
    }
    #[inline(always)]
    fn takes(&self, ray: usize, hit: &Hit) -> bool {
        self(ray, hit)
    }
}

/// Which hits count.
pub(super) trait Filter: Copy {
    /// All do: nothing needs to be asked.
    const ALL: bool;
    /// Whether hits in this instance have to be asked about at all.
    fn asks(&self, instance: u32) -> bool;
    /// Whether a hit of ray number `ray` counts.
    fn takes(&self, ray: usize, hit: &Hit) -> bool;
}

/// All hits count.
#[derive(Clone, Copy)]
pub(super) struct All;

impl Filter for All {
    const ALL: bool = true;
    #[inline(always)]
    fn asks(&self, _: u32) -> bool {
        false
    }
    #[inline(always)]
    fn takes(&self, _: usize, _: &Hit) -> bool {
        true
    }
}

/// Those that somebody takes. Not generic: the kernels are compiled once, whoever is asked.
#[derive(Clone, Copy)]
pub(super) struct Only<'a>(pub &'a dyn Accept);

impl Filter for Only<'_> {
    const ALL: bool = false;
    #[inline(always)]
    fn asks(&self, instance: u32) -> bool {
        self.0.asks(instance)
    }
    #[inline(always)]
    fn takes(&self, ray: usize, hit: &Hit) -> bool {
        self.0.takes(ray, hit)
    }
}
