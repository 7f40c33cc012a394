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
use penumbra::torture::{Effort, Place, Step, Trial};
use penumbra::trace::surface::Interaction;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;
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
#[derive(Clone, Debug, Default)]
pub struct Row {
    pub name: String,
    /// Nearest and any hit, by 10⁷ rays aimed at edges, corners and anywhere.
    pub leaks: [f64; 2],
    /// Rays of which the answers to both questions contradict each other, by 10⁷.
    pub contradictions: f64,
    /// By 10⁶ rays and triangles where exact arithmetic is certain.
    pub wrong: f64,
    /// Below a condition of 1000, in steps of floats: worst, and of 99.9 %.
    pub ulp: [f64; 2],
    /// By 10⁶ rays that leave a triangle by our bound.
    pub own: f64,
    /// By 10⁶ rays along axes and diagonals of a grid.
    pub zero: f64,
    /// 10⁶ rays per second on one thread: nearest and any hit.
    pub speed: [f64; 2],
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
    let speeds = speeds(&contestants);
    let rows: Vec<Row> = contestants
        .iter()
        .zip(speeds)
        .map(|(contestant, speed)| {
            eprintln!("{} ...", contestant.name);
            let row = Row { speed, ..measure(contestant, rays, pairs) };
            eprintln!("{row:?}");
            row
        })
        .collect();
    let head = format!(
        "{rays} rays from inside of closed meshes at 6 places, {pairs} exact pairs of each of {} kinds. One thread for speed. Embree {}.\n",
        FAMILIES.len(),
        engines::embree::version()
    );
    let (markdown, csv) = tables(&rows);
    println!("{head}\n{markdown}");
    if let Some(to) = to {
        let write = |name: &str, text: &str| std::fs::write(format!("{to}/{name}"), text).expect("written");
        write("peers.csv", &csv);
        write("peers.table.md", &format!("{head}\n{markdown}"));
        write("peers.svg", &plot::plot(&rows));
    }
}

fn measure(contestant: &Contestant, rays: u64, pairs: u64) -> Row {
    let maker = contestant.maker();
    let (closest, any, contradictions, tried) = leaking(&maker, rays);
    let by = |count: u64, tried: u64, million: f64| count as f64 / tried as f64 * million;
    let (wrong, ulp) = exact(&maker, pairs);
    let (own, leaving) = own_hits(&maker, 2000);
    let (progress, interrupt) = (|_: Step| {}, AtomicBool::new(false));
    let trial = Trial { effort: Effort::Normal, seed: 1, progress: &progress, interrupt: &interrupt };
    let zero = zero::run(&trial, std::slice::from_ref(&maker));
    let zero = (zero.iter().map(|c| c.ours).sum::<f64>(), zero.iter().map(|c| c.tried).sum::<u64>());
    Row {
        name: contestant.name.to_owned(),
        leaks: [by(closest, tried, 1e7), by(any, tried, 1e7)],
        contradictions: by(contradictions, tried, 1e7),
        wrong,
        ulp,
        own: by(own, leaving, 1e6),
        zero: zero.0 / zero.1 as f64 * 1e6,
        speed: [0.0; 2],
    }
}

/// Case G1.
fn leaking(maker: &Maker<'_>, rays: u64) -> (u64, u64, u64, u64) {
    let mut scenes = Vec::new();
    for (_, triangles) in meshes::closed() {
        scenes.extend(Place::ALL.iter().filter_map(|place| meshes::moved(&triangles, |p| place.point(p))));
        scenes.extend(meshes::moved(&triangles, |p| p + Vec3::new(148_376.0, 1234.0, -223_423.0)));
    }
    let batches = rays.div_ceil(4096 * scenes.len() as u64);
    let mut sums = (0, 0, 0, 0);
    for triangles in &scenes {
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
            let leaks = (count(&|hit, _| !hit), count(&|_, blocked| !blocked));
            (leaks.0, leaks.1, count(&|hit, blocked| hit != blocked), rays.len() as u64)
        };
        let add = |a: (u64, u64, u64, u64), b: (u64, u64, u64, u64)| (a.0 + b.0, a.1 + b.1, a.2 + b.2, a.3 + b.3);
        sums = add(sums, (0..batches).into_par_iter().map(batch).reduce(|| (0, 0, 0, 0), add));
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
        let rays = rays_off(&alone, &mut rng, 500, Interaction::origin_toward);
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
    let mut markdown = "| engine | leaks / 10^7, nearest | leaks / 10^7, any | nearest and any contradict / 10^7 | wrong hit or miss / 10^6 | t: worst ulp | t: 99.9 % ulp | self-hits / 10^6 | wrong along axes / 10^6 | Mrays/s, nearest | Mrays/s, any |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n".to_owned();
    let mut csv = "engine,leaks_nearest_per_1e7,leaks_any_per_1e7,contradictions_per_1e7,wrong_per_1e6,t_worst_ulp,t_999_ulp,self_hits_per_1e6,axes_wrong_per_1e6,mrays_nearest,mrays_any\n".to_owned();
    let short = |x: f64| match x {
        0.0 => "0".to_owned(),
        x if x.abs() >= 1e5 => format!("{x:.1e}"),
        x if x.abs() >= 100.0 => format!("{x:.0}"),
        x if x.abs() >= 1.0 => format!("{x:.1}"),
        x => format!("{x:.2}"),
    };
    for r in rows {
        let numbers = [
            r.leaks[0], r.leaks[1], r.contradictions, r.wrong, r.ulp[0], r.ulp[1], r.own, r.zero, r.speed[0], r.speed[1],
        ];
        let cells: Vec<String> = numbers.iter().map(|&x| short(x)).collect();
        markdown += &format!("| {} | {} |\n", r.name, cells.join(" | "));
        let cells: Vec<String> = numbers.iter().map(|x| format!("{x}")).collect();
        csv += &format!("{},{}\n", r.name, cells.join(","));
    }
    (markdown, csv)
}
