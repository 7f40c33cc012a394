//! How time and memory grow with the number of triangles: a table, and `assets/pictures/growth.svg`.
//! `cargo bench --bench growth -- 7` goes to 10⁷ triangles, which takes 2 GB.
//!
//! Before anything counts, hits are compared with those of trying every triangle.

mod plot;
#[path = "../shapes/mod.rs"]
mod shapes;

use cap::Cap;
use glam::Vec3;
use penumbra::bvh::{Blas, Ray};
use shapes::{compare_with_all, ray_kinds, soup, terrain};
use std::alloc::System;
use std::error::Error;
use std::hint::black_box;
use std::process::{Command, Stdio};
use std::time::Instant;

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

/// Rays of each kind: the square of it.
const SIDE: usize = 512;

/// Builds and traces of one size.
struct Point {
    triangles: usize,
    /// On one thread and on two.
    build_seconds: [f64; 2],
    /// Held by the finished structure, per triangle.
    bytes: f64,
    /// Most that was held while building, per triangle, without the triangles that are given.
    peak_bytes: f64,
    /// Of each kind on one thread, in millions per second.
    rays: [f64; 3],
}

/// A kind of geometry at all its sizes.
struct Growth {
    name: &'static str,
    points: Vec<Point>,
}

/// The fastest of some.
fn seconds<T>(times: usize, mut work: impl FnMut() -> T) -> f64 {
    let timed = (0..times).map(|_| {
        let start = Instant::now();
        let made = black_box(work());
        let seconds = start.elapsed().as_secs_f64();
        drop(made);
        seconds
    });
    timed.fold(f64::INFINITY, f64::min)
}

/// Only for a fresh process: the allocator's mark is never lowered.
fn measure(triangles: &[[Vec3; 3]]) -> Result<Point, Box<dyn Error>> {
    let count = triangles.len();
    let times = (3_000_000 / count).clamp(2, 30);
    let before = MEMORY.allocated();
    let mut build_seconds = [0.0; 2];
    for (threads, result) in (1..).zip(&mut build_seconds) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        *result = pool.install(|| seconds(times, || Blas::build(triangles)));
    }
    let peak = MEMORY.max_allocated() - before;
    let before = MEMORY.allocated();
    let blas = Blas::build(triangles);
    let bytes = MEMORY.allocated() - before;
    let kinds = ray_kinds(&blas, SIDE);
    let mut rays = [0.0; 3];
    for ((kind, asked), result) in kinds.iter().zip(&mut rays) {
        compare_with_all(&blas, triangles, asked, (20_000_000 / count).clamp(4, 256));
        *result = asked.len() as f64 / 1e6 / seconds(5, || trace(&blas, kind, asked));
    }
    let [bytes, peak_bytes] = [bytes, peak].map(|bytes| bytes as f64 / count as f64);
    Ok(Point { triangles: count, build_seconds, bytes, peak_bytes, rays })
}

fn trace(blas: &Blas, kind: &str, rays: &[Ray]) {
    if kind == "shadow" {
        let mut blocked = 0;
        blas.any_hits_by(rays.len(), |i| rays[i], |_, is_blocked| blocked += usize::from(is_blocked));
        black_box(blocked);
    } else {
        let mut hits = 0;
        blas.closest_hits_by(rays.len(), |i| rays[i], |_, hit| hits += usize::from(hit.is_some()));
        black_box(hits);
    }
}

fn table(growth: &Growth) {
    println!(
        "\n| {} | build, 1 thread | 2 threads | bytes | while building | primary | shadow | bounce |",
        growth.name
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|");
    for point in &growth.points {
        let [one, two] = point.build_seconds.map(|seconds| seconds * 1e3);
        let [primary, shadow, bounce] = point.rays;
        let Point { triangles, bytes, peak_bytes, .. } = point;
        println!(
            "| {triangles} | {one:.3} ms | {two:.3} ms | {bytes:.0} | {peak_bytes:.0} \
             | {primary:.2} | {shadow:.2} | {bounce:.2} |"
        );
    }
}

impl Point {
    fn print(&self) {
        let [one, two] = self.build_seconds;
        let [primary, shadow, bounce] = self.rays;
        let Self { triangles, bytes, peak_bytes, .. } = self;
        println!("{triangles} {one} {two} {bytes} {peak_bytes} {primary} {shadow} {bounce}");
    }

    fn read(line: &str) -> Option<Self> {
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let [triangles, one, two, bytes, peak_bytes, primary, shadow, bounce] = numbers.try_into().ok()?;
        let triangles = triangles as usize;
        Some(Self {
            triangles,
            build_seconds: [one, two],
            bytes,
            peak_bytes,
            rays: [primary, shadow, bounce],
        })
    }
}

/// Measures in a process of its own.
fn measure_apart(shape: &str, count: usize) -> Result<Point, Box<dyn Error>> {
    let mut own = Command::new(std::env::current_exe()?);
    let output = own.args([shape, &count.to_string()]).stderr(Stdio::inherit()).output()?;
    let line = String::from_utf8(output.stdout)?;
    Point::read(&line).ok_or_else(|| format!("{count} triangles of {shape}: {}", output.status).into())
}

const SHAPES: [(&str, fn(usize) -> Vec<[Vec3; 3]>); 2] =
    [("terrain", |count| terrain((count as f64 / 2.0).sqrt().round() as usize)), ("soup", soup)];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = arguments.iter().find_map(|argument| argument.parse::<usize>().ok());
    if let (Some(count), Some((_, make))) =
        (number, SHAPES.iter().find(|(shape, _)| arguments.iter().any(|argument| argument == shape)))
    {
        let mut triangles = make(count);
        triangles.shrink_to_fit();
        measure(&triangles)?.print();
        return Ok(());
    }
    let mut all = Vec::new();
    for (name, _) in SHAPES {
        let sizes = (3..=number.unwrap_or(6)).map(|exponent| 10usize.pow(exponent as u32));
        let points = sizes.map(|count| measure_apart(name, count)).collect::<Result<_, _>>()?;
        all.push(Growth { name, points });
        all.last().into_iter().for_each(table);
    }
    println!("\nBytes are per triangle, rays millions a second on one thread.");
    plot::write(&all)
}
