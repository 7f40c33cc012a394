//! G9: of faces in the same place the lowest index is hit, whatever the order of work.

use super::brute::{aimed_ray, ours};
use super::meshes::{Triangles, soup};
use super::stage::{Stage, WIDE, cube, quad};
use crate::bvh::Ray;
use crate::scene::{Light, Material};
use crate::torture::oracle::{Maker, Rng, ask, brute_force};
use crate::torture::{Case, Check, Effort, Place, Trial};
use crate::trace::Film;
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

pub(super) const CASE: Case = Case {
    id: "G9",
    title: "a thousand squares in one place, tripled triangles in any order, a doubled floor",
    limit: "the lowest index, for 1, 2 and 8 threads and any builder; pictures equal to the bit",
    run: |trial| {
        let mut checks = run(trial, &ours());
        checks.extend(floors(trial, floor));
        checks
    },
};

const THREADS: [usize; 3] = [1, 2, 8];

/// Runs `work` with this many threads.
fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Option<T> {
    Some(rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok()?.install(work))
}

/// The case for whatever answers rays.
#[must_use]
pub fn run(trial: &Trial<'_>, makers: &[Maker<'_>]) -> Vec<Check> {
    let count = trial.pick(128, 256, 100_000) as usize;
    let mut checks = Vec::new();
    for (number, place) in Place::ALL.into_iter().enumerate() {
        let part = number as f64 / Place::ALL.len() as f64;
        trial.tell(CASE.id, place.name(), part);
        let mut rng = Rng::numbered(trial.seed, 9);
        let squares = squares(place);
        let into: Vec<Ray> = (0..count).map(|_| into_square(&mut rng, place)).collect();
        // Three of each, in any order: the index of a triangle is its place in the list.
        let single = soup(300, 0.5, 4);
        let tripled: Triangles =
            single.iter().chain(&single).chain(&single).map(|t| t.map(|p| place.point(p))).collect();
        let shuffled: Triangles = rng.order(tripled.len()).iter().map(|&i| tripled[i]).collect();
        let center = place.point(Vec3::ZERO);
        let aimed: Vec<Ray> =
            (0..count).map(|_| aimed_ray(&mut rng, &tripled, 2.0 * place.scale as f32, center)).collect();
        for (name, triangles, rays) in
            [("squares", &squares, &into), ("tripled", &tripled, &aimed), ("shuffled", &shuffled, &aimed)]
        {
            let expected: Vec<_> = rays.par_iter().map(|ray| brute_force(triangles, ray)).collect();
            let lowest = |i: usize| {
                let hit = expected[i]?;
                let corners = triangles[hit.triangle as usize];
                triangles.iter().position(|t| *t == corners).map(|first| first == hit.triangle as usize)
            };
            let not_lowest = (0..rays.len()).filter(|&i| lowest(i) == Some(false)).count() as u64;
            let what = format!("{name}, {}", place.name());
            checks.push(Check::none(format!("trying all: {what}"), rays.len() as u64, "rays", not_lowest));
            for (turn, maker) in makers.iter().enumerate() {
                // Little effort: one number of threads for each maker.
                let chosen = [THREADS[turn % 3]];
                for &threads in if trial.effort == Effort::Quick { &chosen[..] } else { &THREADS } {
                    if trial.interrupted() {
                        return checks;
                    }
                    let wrong = with_threads(threads, || {
                        let tracer = (maker.make)(triangles);
                        let pieces = rays.par_chunks(64).zip(expected.par_chunks(64));
                        pieces.map(|(rays, expected)| ask(tracer.as_ref(), rays).wrong(expected)).sum::<u64>()
                    });
                    let tried = if wrong.is_some() { rays.len() as u64 } else { 0 };
                    let what = format!("{what}, {threads} threads, {}", maker.name);
                    checks.push(Check::none(what, tried, "rays", wrong.unwrap_or(0)));
                }
            }
        }
    }
    checks
}

fn squares(place: Place) -> Triangles {
    let [a, b, c, d] = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y].map(|p| place.point(p));
    (0..1000).flat_map(|_| [[a, b, c], [a, c, d]]).collect()
}

fn into_square(rng: &mut Rng, place: Place) -> Ray {
    let target = Vec3::new(rng.unit(), rng.unit(), 0.0);
    let origin = place.point(target + rng.vec() + Vec3::Z * 2.0);
    Ray::new(origin, place.point(target) - origin)
}

/// A room whose floor is there once, or a second time in another colour: as another face of the same mesh, or as
/// an instance of its own. For whatever makes a picture as [`floor`] does.
#[must_use]
pub fn floors(
    trial: &Trial<'_>,
    floor: impl Fn(&[&[Vec3]], usize, Place, u32) -> Option<Film>,
) -> Vec<Check> {
    let (red, green) = (Vec3::new(0.8, 0.1, 0.1), Vec3::new(0.1, 0.8, 0.1));
    let samples = trial.pick(2, 4, 256) as u32;
    let mut checks = Vec::new();
    for place in Place::ALL {
        let picture = |meshes: &[&[Vec3]], threads: usize| floor(meshes, threads, place, samples);
        let (is_red, is_green) = (picture(&[&[red]], 1), picture(&[&[green]], 1));
        let both = picture(&[&[red], &[green]], 1);
        let mut wrong = u64::from(is_red == is_green) + u64::from(both != is_red);
        for threads in THREADS {
            wrong += u64::from(picture(&[&[red, green]], threads) != is_red);
            wrong += u64::from(picture(&[&[green, red, red]], threads) != is_green);
            wrong += u64::from(picture(&[&[red], &[green]], threads) != both);
        }
        checks.push(Check::none(format!("doubled floor, {}", place.name()), 12, "pictures", wrong));
        if trial.interrupted() {
            break;
        }
    }
    checks
}

/// Each list of colours is a mesh of coincident floors. `None` if there are no such threads.
#[must_use]
pub fn floor(meshes: &[&[Vec3]], threads: usize, place: Place, samples: u32) -> Option<Film> {
    let mut stage = Stage::new(40, 30, place.transform());
    let white = Material { double_sided: true, ..Material::lambert(Vec3::splat(0.7)) };
    stage.add_mesh(cube(), white, DAffine3::from_translation(DVec3::Y));
    stage.add(Light::Point { intensity: Vec3::ONE }, DAffine3::from_translation(DVec3::Y * 1.5));
    for colors in meshes {
        let mut floor = quad(Vec3::new(-1.0, 0.125, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
        floor.triangles = floor.triangles.repeat(colors.len());
        floor.slots = (0..colors.len() as u16).flat_map(|slot| [slot; 2]).collect();
        let materials = colors.iter().map(|&color| Material::lambert(color)).collect();
        stage.add_painted(floor, materials, DAffine3::IDENTITY);
    }
    stage.look(DVec3::new(0.2, 1.4, 0.9), DVec3::new(0.0, 0.2, 0.0), DVec3::Y, WIDE);
    with_threads(threads, || stage.picture(samples))
}
