//! How the noise falls, and when it will have fallen far enough.

/// Relative noise at sample counts, to be continued: noise = a · n^−b.
///
/// n counts samples per pixel rather than seconds: at a constant speed that is the same law, and it is upset
/// neither by a machine that is busy elsewhere for a while nor by a film that comes from an earlier run.
#[derive(Clone, Debug, Default)]
pub struct Convergence {
    /// (ln n, ln noise), n growing.
    points: Vec<(f64, f64)>,
}

/// noise = `a` · n^−`b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLaw {
    /// Noise of one sample per pixel, if the law held that early.
    pub a: f64,
    /// 0.5 for independent samples, more for stratified ones.
    pub b: f64,
}

/// The law is that of the last counts, within this factor of the latest: early samples follow another.
const MEMORY: f64 = 16.0;
/// Fewest counts that a law is drawn through, and how far they must be apart.
const POINTS: usize = 5;
const SPREAD: f64 = 2.0;
/// Slowest and fastest fall that is believed.
const SLOPES: std::ops::Range<f64> = 0.2..1.6;
/// Furthest that the noise may be off the law, in root mean square: 0.1 is 10 %.
const OFF: f64 = 0.1;
/// Widest standard error of a predicted count that is told: 0.35 is within a factor of 1.4.
const DOUBT: f64 = 0.35;

/// How often the noise is looked at: after this many samples per pixel comes the next look.
///
/// Each time the count has grown by an eighth, with both halves of the film of one size. It depends on
/// nothing else, so that a render that ends at a noise level ends at the same count on every machine.
#[must_use]
pub fn next_look(samples: u32) -> u32 {
    match samples {
        0 => 1,
        1 => 2,
        // To an even count at least one more, at most an eighth and two.
        n => n.saturating_add((n / 8).max(1)).saturating_add(1) & !1,
    }
}

/// The first look at a film that has `samples` already.
#[must_use]
pub fn first_look(samples: u32) -> u32 {
    let mut look = 1;
    while look < samples {
        look = next_look(look);
    }
    look
}

/// Fewest samples per pixel to judge a picture by: fewer have not met enough of it to say that it is good enough.
pub const FEWEST_TO_STOP: u32 = 8;
/// If so many have met no light at all, nobody waits for the noise to fall.
pub const DARK_ENOUGH: u32 = 256;

impl Convergence {
    /// Takes note of the noise at a sample count larger than those before; anything else is ignored.
    pub fn note(&mut self, samples: f64, noise: f64) {
        let point = (samples.ln(), noise.ln());
        let grown = self.points.last().is_none_or(|last| point.0 > last.0);
        if point.0.is_finite() && point.1.is_finite() && grown {
            self.points.push(point);
        }
    }

    fn recent(&self) -> &[(f64, f64)] {
        let Some(latest) = self.points.last() else { return &[] };
        let from = self.points.partition_point(|p| p.0 < latest.0 - MEMORY.ln());
        &self.points[from..]
    }

    /// The law, once it holds: enough counts far enough apart, that fall as noise does and lie on one line.
    #[must_use]
    pub fn law(&self) -> Option<PowerLaw> {
        self.line().map(|line| PowerLaw { a: (line.y - line.slope * line.x).exp(), b: -line.slope })
    }

    /// Samples per pixel at which the noise will be `goal`, if the law holds and reaches so far.
    #[must_use]
    pub fn samples_to(&self, goal: f64) -> Option<f64> {
        let line = self.line()?;
        let latest = self.points.last()?.0;
        let at = line.x + (goal.ln() - line.y) / line.slope;
        // Error of the line's height and of its slope, at the place where it is asked.
        let height = line.off / (line.count - 2.0).sqrt() / line.slope.abs();
        let turn = height * (line.count.recip() + (at - line.x).powi(2) / line.spread).sqrt();
        // Neighbouring estimates share most of their samples: their scatter says less than it seems to.
        let doubt = turn * 2.0;
        (doubt < DOUBT && at.is_finite()).then(|| at.max(latest).exp())
    }

    /// Least squares through the recent counts, in logarithms.
    fn line(&self) -> Option<Line> {
        let points = self.recent();
        let (first, last) = (points.first()?, points.last()?);
        if points.len() < POINTS || last.0 - first.0 < SPREAD.ln() {
            return None;
        }
        let count = points.len() as f64;
        let (x, y) = points.iter().fold((0.0, 0.0), |sum, p| (sum.0 + p.0 / count, sum.1 + p.1 / count));
        let spread: f64 = points.iter().map(|p| (p.0 - x).powi(2)).sum();
        let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / spread;
        let off = points.iter().map(|p| (p.1 - y - slope * (p.0 - x)).powi(2)).sum::<f64>().sqrt();
        let holds = SLOPES.contains(&-slope) && off / count.sqrt() < OFF;
        holds.then_some(Line { x, y, slope, spread, off, count })
    }
}

/// y + slope · (ln n − x), and what its error follows from.
struct Line {
    x: f64,
    y: f64,
    slope: f64,
    /// Sum of squares of ln n − x.
    spread: f64,
    /// Root of the sum of squares off the line.
    off: f64,
    count: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks at `noise(n)` until `end` samples.
    fn watch(end: u32, mut noise: impl FnMut(f64) -> f64) -> Convergence {
        let mut convergence = Convergence::default();
        let mut n = 2;
        while n <= end {
            convergence.note(f64::from(n), noise(f64::from(n)));
            n = next_look(n);
        }
        convergence
    }

    /// In −1 to 1, from a counter.
    fn jitter(counter: &mut u32) -> f64 {
        *counter += 1;
        f64::from(crate::trace::sampler::unit_float(crate::trace::sampler::hash(*counter))) * 2.0 - 1.0
    }

    #[test]
    fn a_power_law_is_found_and_foretells() {
        for (a, b) in [(0.5, 0.5), (2.0, 0.74), (0.01, 1.0), (1e6, 0.3)] {
            let convergence = watch(64, |n| a * n.powf(-b));
            let law = convergence.law().unwrap();
            assert!((law.a / a - 1.0).abs() < 1e-9 && (law.b - b).abs() < 1e-9, "{law:?}");
            let goal = a * 5000f64.powf(-b);
            let foretold = convergence.samples_to(goal).unwrap();
            assert!((foretold / 5000.0 - 1.0).abs() < 1e-6, "{foretold}");
        }
    }

    #[test]
    fn jitter_of_some_percent_leaves_a_believable_guess() {
        let mut counter = 0;
        let (mut told, mut worst) = (0, 0f64);
        for _ in 0..100 {
            let convergence = watch(100, |n| 0.8 * n.powf(-0.6) * (1.0 + 0.04 * jitter(&mut counter)));
            // Ten times as many samples as there are.
            if let Some(foretold) = convergence.samples_to(0.8 * 1000f64.powf(-0.6)) {
                told += 1;
                worst = worst.max((foretold / 1000.0).ln().abs());
            }
        }
        assert!(told > 80 && worst < 0.3, "told {told} times, at worst off by a factor of {}", worst.exp());
    }

    #[test]
    fn the_law_is_that_of_the_latest_samples() {
        // Fast at first, as when fireflies become average; then slow.
        let noise = |n: f64| if n < 64.0 { n.powf(-1.0) } else { 64f64.powf(-0.5) * n.powf(-0.5) };
        let convergence = watch(64 * 40, noise);
        assert!((convergence.law().unwrap().b - 0.5).abs() < 1e-6);
    }

    #[test]
    fn nothing_is_told_where_nothing_is_known() {
        assert!(watch(4, |n| n.powf(-0.5)).law().is_none(), "too few");
        let mut near = Convergence::default();
        for n in 100..120 {
            near.note(f64::from(n), f64::from(n).powf(-0.5));
        }
        assert!(near.law().is_none(), "too near to each other");
        let mut counter = 0;
        let nonsense: [(&str, Convergence); 6] = [
            ("constant", watch(1000, |_| 0.1)),
            ("rising", watch(1000, f64::sqrt)),
            ("zero", watch(1000, |_| 0.0)),
            ("no number", watch(1000, |_| f64::NAN)),
            ("noise", watch(1000, |_| 1.5 + jitter(&mut counter))),
            (
                "steps",
                watch(1000, |n| if (n.log2() as u32).is_multiple_of(2) { 1.0 } else { 0.4 } * n.powf(-0.5)),
            ),
        ];
        for (name, convergence) in nonsense {
            assert_eq!(convergence.samples_to(1e-3), None, "{name}: {:?}", convergence.law());
        }
    }

    #[test]
    fn what_is_out_of_order_or_no_number_is_ignored() {
        let mut convergence = watch(64, |n| n.powf(-0.5));
        for (samples, noise) in [(10.0, 5.0), (f64::NAN, 0.1), (100.0, -1.0), (0.0, 0.1)] {
            convergence.note(samples, noise);
        }
        assert!((convergence.law().unwrap().b - 0.5).abs() < 1e-9);
    }

    #[test]
    fn looks_grow_by_an_eighth_and_come_to_an_end() {
        let mut n = 0;
        let mut looks = Vec::new();
        while n < u32::MAX - 2 {
            let next = next_look(n);
            assert!(next > n && (next.is_multiple_of(2) || next == 1));
            assert!(n < 2 || f64::from(next) <= f64::from(n) * 1.125 + 2.0, "{n} {next}");
            looks.push(next);
            n = next;
        }
        assert!(looks.iter().take(50).all(|&n| first_look(n) == n && first_look(n - 1) <= n));
        assert_eq!(looks[..6], [1, 2, 4, 6, 8, 10]);
        assert!(looks.len() < 250, "{}", looks.len());
    }
}
