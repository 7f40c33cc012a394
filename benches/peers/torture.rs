//! The torture chamber's geometric cases on the peers and on us: how fast, and how often wrong. Copied into the
//! peers' harness by `torture.sh`, as a program beside its own.
#![allow(dead_code)]

#[path = "../engine.rs"]
mod engine;
#[path = "../engines/mod.rs"]
mod engines;
#[path = "../math.rs"]
mod math;
#[path = "../torture_plot.rs"]
mod plot;

use engine::{Engine, Hit as PeerHit, MISS, Ray as PeerRay, Tri};
use glam::Vec3;
use penumbra::bvh::{Blas, Hit, Isa, Ray};
use penumbra::torture::geometry::alone::Alone;
use penumbra::torture::geometry::exact::{FAMILIES, Shown, judge};
use penumbra::torture::geometry::leave::{mesh, rays_off};
use penumbra::torture::geometry::{leaks, meshes, zero};
use penumbra::torture::oracle::{Maker, Rng, Tracer, inside};
use penumbra::torture::Place;
use penumbra::trace::surface::Interaction;
use rayon::prelude::*;
use std::time::Instant;

/// Another engine, as a [`Tracer`].
struct Peer(Box<dyn Engine>);

fn peer_ray(ray: &Ray) -> PeerRay {
    // Theirs end where they should, but for an end that is none.
    PeerRay { o: ray.origin.to_array(), tmin: 0.0, d: ray.direction.to_array(), tmax: ray.t_max }
}

fn our_hit(hit: PeerHit) -> Option<Hit> {
    (hit != MISS).then_some(Hit { t: hit.t, u: 0.0, v: 0.0, triangle: hit.prim, instance: 0 })
}

impl Tracer for Peer {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.0.closest(&peer_ray(ray)).and_then(|(t, prim)| our_hit(PeerHit { t, prim }))
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        self.0.occluded(&peer_ray(ray))
    }

    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        let rays: Vec<PeerRay> = rays.iter().map(peer_ray).collect();
        let mut out = vec![MISS; rays.len()];
        self.0.closest_batch(&rays, &mut out);
        hits.iter_mut().zip(out).for_each(|(hit, out)| *hit = our_hit(out));
    }

    fn any_hits(&self, rays: &[Ray], blocked: &mut [bool]) {
        let rays: Vec<PeerRay> = rays.iter().map(peer_ray).collect();
        let mut out = vec![MISS; rays.len()];
        self.0.occluded_batch(&rays, &mut out);
        blocked.iter_mut().zip(out).for_each(|(blocked, out)| *blocked = out != MISS);
    }
}

type MakePeer = fn(&[Tri], usize) -> Box<dyn Engine>;

enum Kind {
    Peer(MakePeer),
    Ours(Isa),
}

struct Contestant {
    name: &'static str,
    kind: Kind,
}

impl Contestant {
    fn maker(&self) -> Maker<'_> {
        match self.kind {
            Kind::Peer(make) => {
                Maker::new(self.name, move |triangles| Peer(make(bytemuck::cast_slice(triangles), 1)))
            }
            Kind::Ours(isa) => Maker::new(self.name, move |t| Blas::build(t).with_isa(isa)),
        }
    }
}

fn contestants() -> Vec<Contestant> {
    const PEERS: [&str; 6] =
        ["embree", "embree-robust", "embree-packet16", "tinybvh-bvh8", "obvhs-cwbvh-medium", "obvhs-bvh2-medium"];
    let peers = engines::all().into_iter().filter(|e| PEERS.contains(&e.name));
    let mut all: Vec<Contestant> =
        peers.map(|e| Contestant { name: e.name, kind: Kind::Peer(e.make) }).collect();
    let textbook = engine::make::<engines::textbook::Textbook> as MakePeer;
    all.push(Contestant { name: "textbook (obvhs-bvh2)", kind: Kind::Peer(textbook) });
    for isa in Isa::available() {
        let name = Box::leak(format!("penumbra {}", isa.name()).into_boxed_str());
        all.push(Contestant { name, kind: Kind::Ours(isa) });
    }
    all
}

/// What one came to.
#[derive(Clone, Debug)]
pub struct Row {
    pub name: String,
    /// By 10⁷ rays aimed at edges, corners and anywhere: nearest hit at the origin, at all places, and any hit.
    pub leaks: [f64; 3],
    /// Rays of which the answers to both questions contradict each other, by 10⁷.
    pub contradictions: f64,
    /// By 10⁶ rays and triangles where exact arithmetic is certain.
    pub wrong: f64,
    /// Below a condition of 1000, in steps of floats: worst, and of 99.9 %.
    pub ulp: [f64; 2],
    /// By 10⁶ rays that leave a triangle by our bound.
    pub own: f64,
    /// By 10⁶ rays along axes and diagonals of a grid.
    pub axes: f64,
    /// 10⁶ rays per second on one thread: nearest and any hit.
    pub speed: [f64; 2],
}

impl Default for Row {
    /// Nothing is known.
    fn default() -> Self {
        let no = f64::NAN;
        Self {
            name: String::new(),
            leaks: [no; 3],
            contradictions: no,
            wrong: no,
            ulp: [no; 2],
            own: no,
            axes: no,
            speed: [no; 2],
        }
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |name: &str, default: u64| {
        let at = arguments.iter().position(|a| a == name);
        at.and_then(|i| arguments.get(i + 1)?.parse().ok()).unwrap_or(default)
    };
    let (rays, pairs) = (number("--rays", 10_000_000), number("--pairs", 20_000));
    let to = arguments.iter().position(|a| a == "--to").and_then(|i| arguments.get(i + 1)).cloned();
    let contestants = contestants();
    if let Some(only) = arguments.iter().position(|a| a == "--only").and_then(|i| arguments.get(i + 1)) {
        let one = contestants.iter().filter(|c| c.name == only);
        return one.for_each(|contestant| measure(contestant, rays, pairs));
    }
    let rows: Vec<Row> = contestants
        .iter()
        .zip(speeds(&contestants))
        .map(|(contestant, speed)| {
            // Each in a process of its own: some do not survive it.
            let mut row = Row { name: contestant.name.to_owned(), speed, ..Row::default() };
            let child = std::process::Command::new(std::env::current_exe().expect("this program"))
                .args(["--only", contestant.name, "--rays", &rays.to_string(), "--pairs", &pairs.to_string()])
                .stderr(std::process::Stdio::null())
                .output()
                .expect("a child");
            for line in String::from_utf8_lossy(&child.stdout).lines() {
                let mut words = line.split(' ');
                let what = words.next().unwrap_or_default();
                let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
                match (what, &numbers[..]) {
                    ("leaks", &[here, all, any, contradict]) => {
                        (row.leaks, row.contradictions) = ([here, all, any], contradict);
                    }
                    ("exact", &[wrong, worst, most]) => (row.wrong, row.ulp) = (wrong, [worst, most]),
                    ("own", &[own]) => row.own = own,
                    ("axes", &[axes]) => row.axes = axes,
                    _ => {}
                }
            }
            eprintln!("{row:?}, {}", child.status);
            row
        })
        .collect();
    let (markdown, csv) = tables(&rows);
    let page = page(&markdown, rays, pairs);
    println!("{page}");
    if let Some(to) = to {
        let write = |name: &str, text: &str| std::fs::write(format!("{to}/{name}"), text).expect("written");
        write("peers.csv", &csv);
        write("peers.md", &page);
        write("peers.svg", &plot::plot(&rows));
    }
}

fn page(table: &str, rays: u64, pairs: u64) -> String {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let cpu = read("/proc/cpuinfo");
    let cpu = cpu.lines().find_map(|line| line.strip_prefix("model name")?.split(": ").nth(1));
    let rustc = std::process::Command::new("rustc").arg("--version").output();
    let rustc = rustc.map(|out| String::from_utf8_lossy(&out.stdout).trim().to_owned()).unwrap_or_default();
    format!(
        "# How fast, and how often wrong\n\n\
         The geometric cases of `penumbra torture` on other engines and on ours, from one run of\n\
         `benches/peers/torture.sh HARNESS --to assets/torture --rays {rays} --pairs {pairs}`.\n\n\
         {} threads of {}, {} ({rustc}); Embree {}, tinybvh 1.6.8, obvhs 0.4.0. All with `target-cpu=native`.\n\n{table}\n\
         ![Speed against leaks](peers.svg)\n\n\
         - *crashed*: the process ended before it was measured.\n\
         - *leaks*: {rays} rays from inside of five closed meshes at six places (origin, 1e3, 1e5, times 1e-3 and 1e3, and\n  \
         (148376, 1234, -223423)), a third at random points of edges, a third exactly at corners; asked in batches.\n\
         - *contradict*: nearest hit and any hit do not agree.\n\
         - *wrong hit or miss*: {pairs} rays and triangles of each of five kinds (random, coordinates 1e-8 to 1e8, slivers of\n  \
         aspect 1e6, at 1e-4 rad, within 4 ulp of an edge) where exact arithmetic has a margin above 8 eps of the products.\n\
         - *t*: of their hits, where the determinant's condition is below 1000, steps of floats from the exact t.\n\
         - *self-hits*: rays that leave triangles of coordinates 1e-8 to 1e8 by our bound of the point's error.\n\
         - *along axes*: directions with components of 0 through a grid of whole numbers: no hit where there is one, the other way\n  \
         round, or t off by more than 4 ulp.\n\
         - *Mrays/s*: one thread, the aimed rays themselves in batches of 4096 out of a knot of 3600 triangles: all hit, and\n  \
         neighbours have little in common but their origin. Best of seven, in turns.\n\
         - *textbook*: Moeller and Trumbore's test of 1997 in obvhs's hierarchy.\n",
        std::thread::available_parallelism().map_or(1, usize::from),
        cpu.unwrap_or("an unknown processor"),
        Isa::available().last().map_or("", |isa| isa.name()),
        engines::embree::version()
    )
}

/// Tells line by line what is known, in case it does not survive the next.
fn measure(contestant: &Contestant, rays: u64, pairs: u64) {
    let maker = contestant.maker();
    let by = |count: u64, tried: u64, million: f64| count as f64 / tried as f64 * million;
    let [here, tried_here, closest, any, contradict, tried] = leaking(&maker, rays);
    println!(
        "leaks {} {} {} {}",
        by(here, tried_here, 1e7),
        by(closest, tried, 1e7),
        by(any, tried, 1e7),
        by(contradict, tried, 1e7)
    );
    let (wrong, tried) = axes(&maker);
    println!("axes {}", by(wrong, tried, 1e6));
    let (wrong, ulp) = exact(&maker, pairs);
    println!("exact {wrong} {} {}", ulp[0], ulp[1]);
    let (own, tried) = own_hits(&maker, 2000);
    println!("own {}", by(own, tried, 1e6));
}

/// Case G3, but for the rule about equals: whether something is hit, and t within 4 ulp.
fn axes(maker: &Maker<'_>) -> (u64, u64) {
    let (mut wrong, mut tried) = (0, 0);
    for (_, grid) in zero::grids() {
        let tracer = (maker.make)(&grid.triangles());
        for d in (0..27).filter(|&d| d != 13) {
            let direction = glam::IVec3::new(d % 3, d / 3 % 3, d / 9) - 1;
            for origin in zero::origins().step_by(7) {
                let ray = Ray::new(origin.as_vec3() * 0.5, direction.as_vec3());
                let expected = grid.first_hit(origin, direction).map(|(steps, _)| steps as f32 * 0.5);
                let right = match (tracer.closest_hit(&ray), expected) {
                    (Some(hit), Some(t)) => (hit.t - t).abs() <= 4.0 * (t.next_up() - t),
                    (hit, expected) => hit.is_none() && expected.is_none(),
                };
                wrong += u64::from(!right);
                tried += 1;
            }
        }
    }
    (wrong, tried)
}

/// Case G1: leaks at the origin of so many, and at all places: nearest, any, contradictions, of so many.
fn leaking(maker: &Maker<'_>, rays: u64) -> [u64; 6] {
    let mut scenes = Vec::new();
    for (_, triangles) in meshes::closed() {
        for place in Place::ALL {
            let moved = meshes::moved(&triangles, |p| place.point(p));
            scenes.extend(moved.map(|t| (place == Place::ORIGIN, t)));
        }
        let far = meshes::moved(&triangles, |p| p + Vec3::new(148_376.0, 1234.0, -223_423.0));
        scenes.extend(far.map(|t| (false, t)));
    }
    let batches = rays.div_ceil(4096 * scenes.len() as u64);
    let mut sums = [0; 6];
    for (here, triangles) in &scenes {
        let tracer = (maker.make)(triangles);
        let origins = inside(&mut Rng(1), triangles, 61);
        let batch = |number: u64| {
            let rays = leaks::outward(&mut Rng::numbered(1, number), triangles, &origins, 4096);
            let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
            tracer.closest_hits(&rays, &mut hits);
            tracer.any_hits(&rays, &mut blocked);
            let count = |is: &dyn Fn(bool, bool) -> bool| {
                hits.iter().zip(&blocked).filter(|(hit, blocked)| is(hit.is_some(), **blocked)).count() as u64
            };
            let (closest, all) = (count(&|hit, _| !hit), rays.len() as u64);
            let (at_origin, tried) = if *here { (closest, all) } else { (0, 0) };
            [at_origin, tried, closest, count(&|_, blocked| !blocked), count(&|hit, blocked| hit != blocked), all]
        };
        let add = |a: [u64; 6], b: [u64; 6]| std::array::from_fn(|i| a[i] + b[i]);
        sums = add(sums, (0..batches).into_par_iter().map(batch).reduce(|| [0; 6], add));
    }
    sums
}

/// Case G2.
fn exact(maker: &Maker<'_>, pairs: u64) -> (f64, [f64; 2]) {
    let mut all = Shown::default();
    for family in FAMILIES {
        let mut rng = Rng::numbered(1, 2);
        for _ in 0..pairs {
            judge(maker, &family.pair(&mut rng, Place::ORIGIN), &mut all);
        }
    }
    let mut ulp: Vec<f64> = all.off.iter().map(|off| off[1]).collect();
    ulp.sort_by(f64::total_cmp);
    let at = |part: f64| ulp.get(((ulp.len() as f64 - 1.0) * part) as usize).copied().unwrap_or(f64::NAN);
    (all.wrong as f64 / (pairs * FAMILIES.len() as u64) as f64 * 1e6, [at(1.0), at(0.999)])
}

/// Case G5, with our bound of the point's error: hits of the triangle that rays leave.
fn own_hits(maker: &Maker<'_>, triangles: u64) -> (u64, u64) {
    let (mut hits, mut tried) = (0, 0);
    for number in 0..triangles {
        let mut rng = Rng::numbered(5, number);
        let corners = [(); 3].map(|()| Vec3::ZERO.map(|_| rng.decades(-8.0, 8.0)));
        let Some(alone) = Alone::new(mesh(&[corners]), glam::DAffine3::IDENTITY) else { continue };
        let tracer = (maker.make)(&[corners]);
        let (rays, _) = rays_off(&alone, &mut rng, 500, Interaction::origin_toward);
        hits += rays.iter().filter(|ray| tracer.any_hit(ray)).count() as u64;
        tried += rays.len() as u64;
    }
    (hits, tried)
}

/// All take turns, the best of seven: aimed rays out of a knot of 3600 triangles and a cube, in batches.
fn speeds(contestants: &[Contestant]) -> Vec<[f64; 2]> {
    let triangles = meshes::knot(12, 150);
    let origins = inside(&mut Rng(1), &triangles, 61);
    let sets: Vec<Vec<Ray>> =
        (0..64).map(|number| leaks::outward(&mut Rng::numbered(3, number), &triangles, &origins, 4096)).collect();
    let theirs: Vec<Vec<PeerRay>> = sets.iter().map(|rays| rays.iter().map(peer_ray).collect()).collect();
    let million = sets.iter().map(Vec::len).sum::<usize>() as f64 * 1e-6;
    enum Ready {
        Peer(Box<dyn Engine>),
        Ours(Blas),
    }
    let ready: Vec<Ready> = contestants
        .iter()
        .map(|c| match c.kind {
            Kind::Peer(make) => Ready::Peer(make(bytemuck::cast_slice(&triangles), 1)),
            Kind::Ours(isa) => Ready::Ours(Blas::build(&triangles).with_isa(isa)),
        })
        .collect();
    let mut best = vec![[f64::INFINITY; 2]; contestants.len()];
    let (mut out, mut hits, mut blocked) = (vec![MISS; 4096], vec![None; 4096], vec![false; 4096]);
    for _ in 0..7 {
        for (ready, best) in ready.iter().zip(&mut best) {
            for any in 0..2 {
                let start = Instant::now();
                match ready {
                    Ready::Peer(engine) => theirs.iter().for_each(|rays| match any {
                        0 => engine.closest_batch(rays, &mut out),
                        _ => engine.occluded_batch(rays, &mut out),
                    }),
                    Ready::Ours(blas) => sets.iter().for_each(|rays| match any {
                        0 => blas.closest_hits(rays, &mut hits),
                        _ => blas.any_hits(rays, &mut blocked),
                    }),
                }
                best[any] = best[any].min(start.elapsed().as_secs_f64());
            }
        }
    }
    best.iter().map(|seconds| seconds.map(|s| million / s)).collect()
}

fn tables(rows: &[Row]) -> (String, String) {
    let mut markdown = "| engine | leaks / 10^7 at the origin | at all places | at all, any hit | nearest and any contradict / 10^7 | wrong hit or miss / 10^6 | t: worst ulp | t: 99.9 % ulp | self-hits / 10^6 | wrong along axes / 10^6 | Mrays/s, nearest | Mrays/s, any |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n".to_owned();
    let mut csv = "engine,leaks_at_origin_per_1e7,leaks_per_1e7,leaks_any_per_1e7,contradictions_per_1e7,wrong_per_1e6,t_worst_ulp,t_999_ulp,self_hits_per_1e6,axes_wrong_per_1e6,mrays_nearest,mrays_any\n".to_owned();
    let short = |x: f64| match x {
        x if x.is_nan() => "crashed".to_owned(),
        0.0 => "0".to_owned(),
        x if x.abs() >= 1e5 => format!("{x:.1e}"),
        x if x.abs() >= 100.0 => format!("{x:.0}"),
        x if x.abs() >= 1.0 => format!("{x:.1}"),
        x => format!("{x:.2}"),
    };
    for r in rows {
        let numbers = [
            r.leaks[0], r.leaks[1], r.leaks[2], r.contradictions, r.wrong, r.ulp[0], r.ulp[1], r.own, r.axes, r.speed[0],
            r.speed[1],
        ];
        let cells: Vec<String> = numbers.iter().map(|&x| short(x)).collect();
        markdown += &format!("| {} | {} |\n", r.name, cells.join(" | "));
        let cells: Vec<String> = numbers.iter().map(|x| format!("{x}")).collect();
        csv += &format!("{},{}\n", r.name, cells.join(","));
    }
    (markdown, csv)
}
