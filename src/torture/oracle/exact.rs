//! Real numbers without rounding: sums of floats that do not overlap.
//!
//! Reference: J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric
//! Predicates", Discrete & Computational Geometry 18, 1997, theorems 10 (growing) and 19 (scaling).

use std::ops::{Add, Mul, Neg, Sub};

/// An exact number, made of single precision floats by sums and products of degree up to 6: beyond that
/// double precision, of which the parts are, might overflow or lose its last bits.
#[derive(Clone, Debug, Default)]
pub struct Exact(Vec<f64>);

/// a + b and what was rounded off (Knuth).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// Into two halves of 26 bits (Dekker).
fn halves(a: f64) -> (f64, f64) {
    let c = a * ((1u64 << 27) + 1) as f64;
    let high = c - (c - a);
    (high, a - high)
}

/// a b and what was rounded off (Dekker; a fused operation is not on every machine).
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let ((a, c), (b, d)) = (halves(a), halves(b));
    (product, c * d - (((product - a * b) - c * b) - a * d))
}

impl Exact {
    /// The sum with one float more.
    fn grow(&mut self, x: f64) {
        let mut rest = x;
        let mut kept = 0;
        for i in 0..self.0.len() {
            let (sum, error) = two_sum(rest, self.0[i]);
            rest = sum;
            if error != 0.0 {
                self.0[kept] = error;
                kept += 1;
            }
        }
        self.0.truncate(kept);
        if rest != 0.0 {
            self.0.push(rest);
        }
    }

    /// −1, 0 or 1.
    #[must_use]
    pub fn sign(&self) -> i32 {
        self.0.last().map_or(0, |&x| if x > 0.0 { 1 } else { -1 })
    }

    /// Rounded to double precision, within two units in the last place.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.0.iter().sum()
    }
}

impl From<f32> for Exact {
    fn from(x: f32) -> Self {
        let mut exact = Self::default();
        exact.grow(f64::from(x));
        exact
    }
}

impl Add for &Exact {
    type Output = Exact;

    fn add(self, other: Self) -> Exact {
        let mut sum = self.clone();
        other.0.iter().for_each(|&x| sum.grow(x));
        sum
    }
}

impl Neg for &Exact {
    type Output = Exact;

    fn neg(self) -> Exact {
        Exact(self.0.iter().map(|x| -x).collect())
    }
}

impl Sub for &Exact {
    type Output = Exact;

    fn sub(self, other: Self) -> Exact {
        let mut difference = self.clone();
        other.0.iter().for_each(|&x| difference.grow(-x));
        difference
    }
}

impl Mul for &Exact {
    type Output = Exact;

    fn mul(self, other: Self) -> Exact {
        let mut sum = Exact::default();
        for &x in &self.0 {
            for &y in &other.0 {
                let (product, error) = two_product(x, y);
                sum.grow(error);
                sum.grow(product);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::torture::oracle::Rng;

    /// Of whole numbers of 24 bits, moved apart by up to 30 bits: as integers of 128 bits say.
    #[test]
    fn sums_and_products_are_those_of_whole_numbers() {
        let mut rng = Rng(9);
        for _ in 0..20_000 {
            let mut any = || {
                let whole = i128::from(rng.bits() >> 8) - (1 << 23);
                let shift = rng.below(6);
                (Exact::from((whole << shift) as f32), whole << shift)
            };
            let (a, b, c, d) = (any(), any(), any(), any());
            let exact = &(&(&a.0 * &b.0) - &(&c.0 * &d.0)) * &(&a.0 + &d.0);
            let whole = (a.1 * b.1 - c.1 * d.1) * (a.1 + d.1);
            assert_eq!(exact.sign(), whole.signum() as i32);
            let parts: i128 = exact.0.iter().map(|&x| x as i128).sum();
            assert_eq!(parts, whole);
        }
    }

    #[test]
    fn nothing_is_lost_at_the_ends_of_single_precision() {
        let (least, most) = (Exact::from(f32::from_bits(1)), Exact::from(f32::MAX));
        let tiny = &(&least * &least) * &(&least * &least);
        assert_eq!(tiny.sign(), 1);
        let large = &(&most * &most) * &(&most * &most);
        assert_eq!((&(&large + &tiny) - &large).value(), tiny.value());
        assert_eq!((&large - &large).sign(), 0);
        assert_eq!((&-&large + &large).sign(), 0);
    }

    /// Jeannerod, Louvet and Muller's kind of case: naive single precision says −128.
    #[test]
    fn a_cancelling_difference_of_products_is_exact() {
        let [a, b, c, d] = [33962.035f32, -30438.8, -24871.969, 41563.4].map(Exact::from);
        let exact = (&(&a * &b) - &(&c * &d)).value();
        assert!((exact + 75.1656).abs() < 1e-3, "{exact}");
    }
}
