//! Random numbers, sums and errors that are a little wrong.

use crate::{finds, trial};
use bevy_ecs::prelude::*;
use glam::{Vec2, Vec3};
use penumbra::load::{Made, SceneSource};
use penumbra::scene::{ActiveCamera, Camera, Light, Transform};
use penumbra::torture::Check;
use penumbra::torture::light::lamps::quads;
use penumbra::torture::light::meter::{Ask, ours};
use penumbra::torture::light::numbers::{below_one, neighbours, net, next_seed, over_seeds, unbiased};
use penumbra::torture::light::pictures::{
    adaptively, bias, bias_of_columns, bit_of_everything, columns, columns_in_closed_form, differing,
    in_passes, strip,
};
use penumbra::torture::light::shadows::penumbra;
use penumbra::torture::light::slopes::{Slope, errors, judge_long_run, judge_slope};
use penumbra::torture::light::sums::{Accumulator, a_day, adding, exposed, poison, poisoned_film, scenes};
use penumbra::torture::oracle::Rng;
use penumbra::torture::stage::{Stage, reds};
use penumbra::trace::allot::{EVEN, RIPE};
use penumbra::trace::sampler::{Sampler, hash, unit_float};
use penumbra::trace::{Film, Sampling, TraceScene, trace_pass};

#[test]
fn bits_that_become_one_are_found() {
    assert!(!below_one("by multiplication", |x| x as f32 * 2f32.powi(-32)).holds());
    assert!(!below_one("one too large", |x| (x >> 8) as f32 / ((1 << 24) - 1) as f32).holds());
}

#[test]
fn points_that_are_no_net_are_found() {
    let good = |i: u32| Sampler::new(glam::UVec2::new(5, 9), 2 * i, 1).pair(3);
    assert!(net("ours", 12, good).holds());
    // An index in f32 forgets its last bit after 2²⁴.
    let first = (1 << 24) + 1;
    let rounded = |i: u32| good((first + i) as f32 as u32);
    assert!(!net("index in f32", 12, rounded).holds());
    let mut rng = Rng(1);
    let random: Vec<Vec2> = (0..4096).map(|_| rng.pair()).collect();
    assert!(!net("random", 12, |i| random[i as usize]).holds());
    // One point of all.
    assert!(!net("one moved", 12, |i| if i == 100 { Vec2::splat(0.3) } else { good(i) }).holds());
}

#[test]
fn weak_scrambling_is_found() {
    let points = [(6, 2)];
    let fair = over_seeds("ours", 10_000, 0, &points, |i, p, s| Sampler::new(glam::UVec2::ONE, i, s).pair(p));
    assert!(fair.holds(), "{fair:?}");
    let low_bits = |_, _, seed: u32| Vec2::new(unit_float(0x1234_5678 ^ seed), unit_float(hash(seed)));
    assert!(!over_seeds("only low bits change", 10_000, 0, &points, low_bits).holds());
    let shifted = |_, _, seed: u32| Vec2::new(unit_float(seed << 18), unit_float(hash(seed)));
    assert!(!over_seeds("too even", 10_000, 0, &points, shifted).holds());
}

#[test]
fn a_small_bias_of_few_samples_is_found() {
    let mut rng = Rng(2);
    let estimates: Vec<f64> = (0..100_000).map(|_| 0.9 + 0.2 * f64::from(rng.unit())).collect();
    assert!(unbiased("fair", 1, &estimates, 1.0, 1e-3).iter().all(Check::holds));
    finds("errors off", &unbiased("off", 1, &estimates, 1.002, 1e-3));
    finds("relative", &unbiased("few", 1, &estimates[..1000], 1.0, 1e-3));
}

#[test]
fn repeated_seeds_are_found() {
    let spots = penumbra(1.0, 5);
    let pixels = ours(&Ask { side: 128, ..Ask::new(&spots[2], 2, 0) }, &|| true).pixels;
    assert!(neighbours("ours", 128, &pixels).holds());
    // Pairs of neighbours have one seed.
    let pairs: Vec<f64> = (0..pixels.len()).map(|i| pixels[i & !1]).collect();
    assert!(!neighbours("pairs", 128, &pairs).holds());
    // All tiles have the same seeds.
    let tiles: Vec<f64> = (0..pixels.len()).map(|i| pixels[(i / 128 % 8) * 128 + i % 8]).collect();
    assert!(!neighbours("tiles", 128, &tiles).holds());
    assert!(!neighbours("no noise at all", 128, &vec![1.0; 128 * 128]).holds());
}

#[test]
fn seeds_with_the_same_noise_are_found() {
    let spots = penumbra(1.0, 5);
    let picture = |seed| ours(&Ask { side: 128, ..Ask::new(&spots[2], 2, seed) }, &|| true).pixels;
    let (this, next) = (picture(0), picture(1));
    assert!(next_seed("ours", &this, &next).holds());
    assert!(!next_seed("the same", &this, &this).holds());
    // A tenth of the pixels keep theirs.
    let kept = this.iter().zip(&next).enumerate().map(|(i, (a, b))| if i % 10 == 0 { *a } else { *b });
    assert!(!next_seed("a tenth is kept", &this, &kept.collect::<Vec<f64>>()).holds());
    assert!(!next_seed("no noise at all", &[1.0; 64], &[1.0; 64]).holds());
}

/// What many do.
#[derive(Clone, Default)]
struct Single {
    sums: [f32; 2],
    counts: [u32; 2],
}

impl Accumulator for Single {
    fn add(&mut self, index: u32, sample: f32) -> bool {
        let half = index as usize & 1;
        self.sums[half] += sample;
        self.counts[half] += 1;
        true
    }
    fn mean(&self) -> f64 {
        f64::from((self.sums[0] + self.sums[1]) / (self.counts[0] as f32 + self.counts[1] as f32))
    }
    fn halves(&self) -> [f64; 2] {
        [0, 1].map(|half| f64::from(self.sums[half] / self.counts[half] as f32))
    }
    fn merge(&mut self, other: &Self) {
        for half in 0..2 {
            self.sums[half] += other.sums[half];
            self.counts[half] = self.counts[half].wrapping_add(other.counts[half]);
        }
    }
    fn count(&self) -> u64 {
        // As who divides by it in single precision knows it.
        self.counts.iter().sum::<u32>() as f32 as u64
    }
}

/// And what is better, but not good enough for 2³² samples: a running mean in f64.
#[derive(Clone, Default)]
struct Running {
    halves: [(f64, u64); 2],
}

impl Accumulator for Running {
    fn add(&mut self, index: u32, sample: f32) -> bool {
        let (mean, count) = &mut self.halves[index as usize & 1];
        *count += 1;
        *mean += (f64::from(sample) - *mean) / *count as f64;
        true
    }
    fn mean(&self) -> f64 {
        let [(a, m), (b, n)] = self.halves;
        (a * m as f64 + b * n as f64) / (m + n) as f64
    }
    fn halves(&self) -> [f64; 2] {
        self.halves.map(|(mean, _)| mean)
    }
    fn merge(&mut self, other: &Self) {
        for half in 0..2 {
            let ((a, m), (b, n)) = (self.halves[half], other.halves[half]);
            self.halves[half] = ((a * m as f64 + b * n as f64) / (m + n).max(1) as f64, m + n);
        }
    }
    fn count(&self) -> u64 {
        self.halves.iter().map(|(_, count)| count).sum()
    }
}

#[test]
fn sums_in_single_precision_are_found() {
    let checks = adding::<Single>(&trial(), 1 << 26);
    for word in ["0.1", "ones", "numbers in", "halves of", "variance of", "variance beside"] {
        finds(word, &checks);
    }
    let checks = a_day::<Single>(1 << 24, 0);
    finds("a day", &checks);
    finds("change nothing", &checks);
    finds("not counted", &checks);
    assert!(!poison::<Single>().holds());
    assert!(!poison::<Running>().holds());
}

#[test]
fn poison_in_a_film_is_found() {
    let said = |change: fn(&mut Vec<f64>, &mut [u64; 2])| {
        poisoned_film(|stage: &mut Stage| {
            let (mut pixels, mut counts) = exposed(stage);
            change(&mut pixels, &mut counts);
            (pixels, counts)
        })
    };
    assert!(said(|_, _| ()).iter().all(Check::holds));
    finds("spoilt", &said(|pixels, _| pixels[9] = f64::NAN));
    // Left out in silence, or one of them let in.
    finds("not counted", &said(|_, counts| counts[1] = 0));
    finds("not counted", &said(|_, counts| counts[1] -= 1));
}

#[test]
fn a_scene_that_makes_no_numbers_is_found() {
    let make = |world: &mut World| {
        let camera = (Camera::default(), Transform::default());
        let camera = world.spawn(camera).id();
        world.insert_resource(ActiveCamera(camera));
        world.spawn((Light::Environment { radiance: Vec3::NAN }, Transform::default()));
        Vec::new()
    };
    let source = SceneSource::Made(Made { name: "no number", make });
    finds("dropped", &scenes(&trial(), [source].into_iter()));
    finds("cannot be opened", &scenes(&trial(), [SceneSource::BuiltIn("nowhere")].into_iter()));
}

#[test]
fn a_variance_of_rounded_sums_is_found() {
    // f32 of 1e4 has steps of a thousandth; here they are of an eighth.
    #[derive(Clone, Default)]
    struct Coarse(Single);
    impl Accumulator for Coarse {
        fn add(&mut self, index: u32, sample: f32) -> bool {
            self.0.add(index, (sample * 8.0).round() / 8.0)
        }
        fn mean(&self) -> f64 {
            self.0.mean()
        }
        fn halves(&self) -> [f64; 2] {
            self.0.halves()
        }
        fn merge(&mut self, other: &Self) {
            self.0.merge(&other.0);
        }
        fn count(&self) -> u64 {
            self.0.count()
        }
    }
    let checks = adding::<Coarse>(&trial(), 1000);
    finds("halves of", &checks);
    finds("variance of", &checks);
    finds("variance beside", &checks);
}

/// A pixel that ends when its own halves agree is biased, most where it is dark.
#[test]
fn stopping_early_is_found() {
    let (stage, by_column) = (strip(), columns_in_closed_form());
    let film = |seed: u32, samples: u32| {
        let settings = penumbra::trace::RenderSettings { seed, ..*stage.scene().settings };
        let scene = TraceScene { settings: &settings, ..stage.scene() };
        let mut film = Film::new(settings.size, 0);
        trace_pass(&scene, &mut film, samples, samples, || true);
        film
    };
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let exact = mean(&by_column);
    let (mut stopping, mut fair) = (Vec::new(), Vec::new());
    for seed in 0..200 {
        // Beyond the samples by which shares are found anew.
        let (all, few) = (film(seed, RIPE + 4), film(seed, EVEN));
        // Dark by chance is dark for ever.
        let pairs = reds(&all).into_iter().zip(reds(&few));
        let stopped = pairs.map(|(all, few)| if few == 0.0 { 0.0 } else { all });
        let stopped: Vec<f64> = stopped.collect();
        let column = |x: usize| mean(&stopped.iter().skip(x).step_by(48).copied().collect::<Vec<f64>>());
        stopping.push((0..48).map(column).collect::<Vec<f64>>());
        fair.push(columns(&adaptively(&stage, seed, RIPE + 4, false)));
    }
    let means = |pictures: &[Vec<f64>]| pictures.iter().map(|columns| mean(columns)).collect::<Vec<f64>>();
    finds("standard errors off", &bias("stopping", 1, &means(&stopping), exact));
    finds("columns", &[bias_of_columns("stopping", 1, &stopping, &by_column)]);
    let holds = |pictures: &[Vec<f64>]| {
        let mut checks = bias("", 1, &means(pictures), exact);
        checks.push(bias_of_columns("", 1, pictures, &by_column));
        checks
    };
    let checks = holds(&fair);
    assert!(checks.iter().all(Check::holds), "{checks:#?}");
    // A fifth less in the darkest column that has light, made up for in the brightest: the mean knows nothing of that.
    for picture in &mut fair {
        picture[47] += 0.2 * picture[8];
        picture[8] *= 0.8;
    }
    let checks = holds(&fair);
    finds("columns", &checks);
    assert!(checks.iter().all(|check| check.holds() || check.what.contains("columns")), "{checks:#?}");
}

#[test]
fn another_film_is_found() {
    let reference = in_passes(&bit_of_everything(0), 2, &[4]);
    assert!(differing("itself", &reference, &reference).holds());
    assert!(!differing("another seed", &in_passes(&bit_of_everything(1), 2, &[4]), &reference).holds());
    assert!(!differing("a sample more", &in_passes(&bit_of_everything(0), 2, &[5]), &reference).holds());
    let mut one = reference.clone();
    one.tiles_mut()[3].pixels_mut()[5].add(0, Vec3::splat(1e-9));
    assert_eq!(differing("one pixel", &one, &reference).ours, 1.0);
}

#[test]
fn slopes_that_are_too_flat_are_found() {
    let spot = &quads()[0];
    let right = |ask: &Ask| ours(ask, &|| true);
    let independent = errors(spot, Sampling::Independent, 4, 0, &right);
    finds("slope", &judge_slope("independent for Sobol'", 1, &independent, Slope::Below(-0.9)));
    // Seeds that are not drawn afresh: all of a picture's pixels are one.
    let repeated = errors(spot, Sampling::Independent, 1, 0, &|ask| {
        let mut reading = right(ask);
        let first = reading.pixels[0];
        reading.pixels.fill(first);
        reading
    });
    finds("slope", &judge_slope("one pixel", 1, &repeated, Slope::Within(-0.5, 0.02)));
    // A bias of a thousandth.
    let biased = errors(spot, Sampling::Sobol, 2, 0, &|ask| {
        let mut reading = right(ask);
        reading.pixels.iter_mut().for_each(|pixel| *pixel *= 1.001);
        reading
    });
    finds("four times the samples", &judge_slope("biased", 1, &biased, Slope::Below(-0.9)));
}

#[test]
fn a_run_that_stalls_or_drifts_is_found() {
    let mut rng = Rng(3);
    let mut run = |error: &dyn Fn(f64) -> (f64, f64)| -> Vec<(u64, Vec<f64>)> {
        let step = |k: i32| {
            let n = 1 << (6 + k);
            let (bias, noise) = error(f64::from(n));
            let pixels = (0..256).map(|_| 1.0 + bias + noise * (f64::from(rng.unit()) - 0.5)).collect();
            (n as u64, pixels)
        };
        (0..12).map(step).collect()
    };
    let fair = judge_long_run("fair", &run(&|n| (0.0, 1.0 / n.sqrt())), 1.0);
    assert!(fair.iter().all(Check::holds), "{fair:#?}");
    finds("drift", &judge_long_run("drifts", &run(&|n| (1e-6 * n, 1.0 / n.sqrt())), 1.0));
    finds("error beside", &judge_long_run("stalls", &run(&|n| (0.0, 1.0 / n.min(256.0).sqrt())), 1.0));
}
