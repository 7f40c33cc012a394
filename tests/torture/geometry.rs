//! G and C: each case at little effort, and saboteurs in the engine's place.

use glam::{DVec3, Vec3};
use penumbra::bvh::{Aabb, Blas, Hit, Placement, Ray, Tlas};
use penumbra::torture::geometry::{
    brute, dark, exact, far, instances, leaks, leave, meshes, ties, worst, zero,
};
use penumbra::torture::oracle::{Brute, Maker, Rng, Tracer, ask, moller_trumbore};
use penumbra::torture::{self, Check, Effort, Step, Trial};
use penumbra::trace::surface::Interaction;
use std::sync::atomic::AtomicBool;

pub fn quick<T>(job: impl FnOnce(&Trial<'_>) -> T) -> T {
    let (progress, interrupt) = (|_: Step| {}, AtomicBool::new(false));
    job(&Trial { effort: Effort::Quick, seed: 1, progress: &progress, interrupt: &interrupt })
}

/// All limits of a case are kept, but for those that are stated.
fn holds(id: &str) {
    let case = torture::cases().into_iter().find(|case| case.id == id).expect("there is such a case");
    let tried = quick(|trial| torture::run(&case, trial));
    for check in tried.checks.iter().filter(|check| !check.holds()) {
        let excuse = check.excuse.unwrap_or("BROKEN");
        println!("{id}: {}: {} > {} of {}: {excuse}", check.what, check.ours, check.limit, check.tried);
    }
    println!("{id}: {} checks, {:.2} s", tried.checks.len(), tried.seconds);
    assert!(tried.holds_but_for_what_is_stated(), "{id}");
}

macro_rules! hold {
    ($($name:ident: $id:literal;)*) => { $(#[test] fn $name() { holds($id); })* };
}

hold! {
    no_ray_leaves_a_closed_mesh: "G1";
    hits_are_those_of_exact_arithmetic: "G2";
    zero_direction_components_miss_nothing: "G3";
    boxes_find_what_trying_all_finds: "G4";
    no_ray_comes_back_to_the_triangle_it_leaves: "G5";
    no_ray_leaps_over_a_gap: "G5-gap";
    no_light_comes_into_a_closed_room: "G5-room";
    shadow_rays_end_where_they_should: "G6";
    far_away_is_like_here: "G7";
    degenerate_triangles_spoil_no_pixel: "G8";
    of_coincident_faces_the_lowest_index_is_hit: "G9";
    the_worst_triangles_are_built_over_and_found: "G10";
    placed_meshes_are_hit_where_they_are: "G11";
    cameras_make_right_rays_at_their_ends: "C1";
    eyes_may_be_anywhere: "C2";
    none_one_and_many_are_counted: "C3";
    nothing_need_have_an_extent: "C4";
}

/// Some of the checks with this in their name are broken.
pub fn finds(checks: &[Check], what: &str) {
    let named: Vec<&Check> = checks.iter().filter(|check| check.what.contains(what)).collect();
    assert!(!named.is_empty(), "no check of {what}");
    let broken = named.iter().filter(|check| !check.holds() && check.excuse.is_none()).count();
    println!("{broken} of {} checks of {what} break", named.len());
    assert!(broken > 0, "{what}: {:?}", named[0]);
}

/// The engine, but for what somebody makes of its answers.
struct Sabotaged {
    blas: Blas,
    triangles: Vec<[Vec3; 3]>,
    change: fn(&[[Vec3; 3]], &Ray, Option<Hit>) -> Option<Hit>,
}

impl Tracer for Sabotaged {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        (self.change)(&self.triangles, ray, self.blas.closest_hit(ray))
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        self.closest_hit(ray).is_some()
    }
}

pub fn sabotaged(change: fn(&[[Vec3; 3]], &Ray, Option<Hit>) -> Option<Hit>) -> Vec<Maker<'static>> {
    vec![Maker::new("saboteur", move |triangles| Sabotaged {
        blas: Blas::build(triangles),
        triangles: triangles.to_vec(),
        change,
    })]
}

fn textbook() -> Vec<Maker<'static>> {
    vec![Maker::new("textbook", |triangles| Brute::new(triangles, moller_trumbore))]
}

/// t moved by so many of its floats' steps.
fn late(hit: Option<Hit>, steps: u32) -> Option<Hit> {
    hit.map(|hit| Hit { t: (0..steps).fold(hit.t, |t, _| t.next_up()), ..hit })
}

/// A box that is a twentieth too small: what is in the last of three parts of it is lost.
fn lost(triangles: &[[Vec3; 3]], ray: &Ray, hit: Option<Hit>) -> Option<Hit> {
    let part = &triangles[..triangles.len() / 3];
    let aabb = part.iter().fold(Aabb::EMPTY, |all, t| all.union(Aabb::around(t)));
    let cut = aabb.max.y - 0.05 * (aabb.max.y - aabb.min.y);
    hit.filter(|hit| hit.triangle as usize >= part.len() || ray.at(hit.t).y < cut)
}

/// One triangle is a hundred thousandth smaller.
#[test]
fn an_open_edge_is_found() {
    let open = Maker::new("open", |triangles| {
        let mut triangles = triangles.to_vec();
        let center = triangles[40].iter().sum::<Vec3>() / 3.0;
        triangles[40] = triangles[40].map(|p| p.lerp(center, 1e-5));
        Blas::build(&triangles)
    });
    let checks = quick(|trial| leaks::run(trial, &[open]));
    finds(&checks, "bumpy sphere, origin");
    finds(&checks, "knot, times 1e3");
}

#[test]
fn a_box_that_is_too_small_is_found() {
    finds(&quick(|trial| leaks::run(trial, &sabotaged(lost))), "origin");
    finds(&quick(|trial| brute::run(trial, &sabotaged(lost))), "knot");
}

#[test]
fn a_hit_of_the_worst_triangles_that_is_off_is_found() {
    let triangles = meshes::soup(500, 0.1, 3);
    let change = |_: &[[Vec3; 3]], _: &Ray, hit| late(hit, 1);
    let saboteur = Sabotaged { blas: Blas::build(&triangles), triangles: triangles.clone(), change };
    finds(&quick(|trial| worst::hits(trial, "soup", &triangles, &[("saboteur", saboteur)])), "hits");
}

#[test]
fn the_textbook_leaks_and_errs() {
    let spheres = Maker::new("textbook", |triangles| Brute::new(triangles, moller_trumbore));
    let mesh = meshes::bumpy_sphere();
    let origins = [Vec3::new(0.1, 0.2, -0.1)];
    let rays = leaks::outward(&mut Rng(5), &mesh, &origins, 20_000);
    let leaks = ask((spheres.make)(&mesh).as_ref(), &rays).leaks();
    println!("the textbook leaks {leaks} of {}", rays.len());
    assert!(leaks > 10);
    finds(&quick(|trial| exact::run(trial, &textbook())), "hit or miss");
}

#[test]
fn t_that_is_off_is_found() {
    let checks = quick(|trial| exact::run(trial, &sabotaged(|_, _, hit| late(hit, 64))));
    finds(&checks, "t, of what its condition allows: unit");
    let checks = quick(|trial| zero::run(trial, &sabotaged(|_, _, hit| late(hit, 4))));
    finds(&checks, "grid");
    finds(&checks, "1e-30");
    finds(&checks, "1e-45");
    finds(&quick(|trial| brute::run(trial, &sabotaged(|_, _, hit| late(hit, 1)))), "soup");
    finds(
        &quick(|trial| brute::run(trial, &sabotaged(|_, _, hit| late(hit, 1)))),
        "rays that end at their hit",
    );
}

/// T. Kay and J. Kajiya's test of boxes as it is mostly written: with 0 · ∞ where an origin is in the plane of a
/// face and the direction along it.
fn slab(triangles: &[[Vec3; 3]], ray: &Ray, hit: Option<Hit>) -> Option<Hit> {
    let hit = hit?;
    let aabb = Aabb::around(&triangles[hit.triangle as usize]);
    let inverse = 1.0 / ray.direction;
    let (a, b) = ((aabb.min - ray.origin) * inverse, (aabb.max - ray.origin) * inverse);
    let (mut near, mut far) = (0.0f32, f32::INFINITY);
    for axis in 0..3 {
        let (enter, leave) = if inverse[axis] < 0.0 { (b[axis], a[axis]) } else { (a[axis], b[axis]) };
        // As vectors do: the second where one of them is no number.
        near = if near > enter { near } else { enter };
        far = if far < leave { far } else { leave };
    }
    (near <= far).then_some(hit)
}

#[test]
fn zero_times_infinity_is_found() {
    let checks = quick(|trial| zero::run(trial, &sabotaged(slab)));
    finds(&checks, "full grid");
    finds(&checks, "flat box");
}

/// Seeds of which needles were hit from outside as long as their normals came of their two long edges.
#[test]
fn no_ray_comes_back_to_a_needle_either() {
    let (progress, interrupt) = (|_: Step| {}, AtomicBool::new(false));
    for seed in [5, 7, 27] {
        let trial = Trial { effort: Effort::Normal, seed, progress: &progress, interrupt: &interrupt };
        for check in leave::own_hits(&trial, Interaction::origin_toward) {
            assert!(check.holds(), "seed {seed}, {}: {} of {}", check.what, check.ours, check.tried);
        }
    }
}

fn fixed_epsilon(at: &Interaction, direction: Vec3) -> Vec3 {
    let side = if at.geometric_normal.dot(direction) < 0.0 { -1e-4 } else { 1e-4 };
    at.position + at.geometric_normal * side
}

#[test]
fn a_fixed_epsilon_is_found() {
    let checks = quick(|trial| leave::own_hits(trial, fixed_epsilon));
    finds(&checks, "origin");
    finds(&checks, "placed by a transform");
    let checks = quick(|trial| leave::gaps(trial, fixed_epsilon));
    finds(&checks, "smallest gap in ulp, origin");
    finds(&checks, "spheres, origin");
}

#[test]
fn a_room_with_an_open_edge_is_found() {
    let mut rooms = dark::closed_rooms();
    for (_, room) in &mut rooms {
        let corners = room.corners(3);
        let first = room.positions.len() as u32;
        let center = corners.iter().sum::<Vec3>() / 3.0;
        room.positions.extend(corners.map(|p| p.lerp(center, 0.02)));
        room.triangles[3] = [first, first + 1, first + 2];
        assert!(!dark::is_room(room));
    }
    assert!(dark::closed_rooms().iter().all(|(_, room)| dark::is_room(room)));
    let checks = quick(|trial| dark::rooms(trial, &rooms));
    finds(&checks, "cube");
    finds(&checks, "bumpy sphere");
}

#[test]
fn a_shadow_ray_that_ends_too_early_is_found() {
    // An occluder on the other side of the light is what a shadow ray that ends too early or too late sees.
    let checks = quick(|trial| dark::ends(trial, -0.01));
    finds(&checks, "before: origin");
    finds(&checks, "off behind, of 4.5 σ: origin");
}

#[test]
fn coordinates_that_stay_large_are_found() {
    finds(&quick(|trial| far::run(trial, Some(DVec3::ZERO))), "at 1e7");
}

/// Of equals the last.
fn last(triangles: &[[Vec3; 3]], _: &Ray, hit: Option<Hit>) -> Option<Hit> {
    let hit = hit?;
    let corners = triangles[hit.triangle as usize];
    let last = triangles.iter().rposition(|t| *t == corners).unwrap_or(0);
    Some(Hit { triangle: last as u32, ..hit })
}

#[test]
fn another_rule_for_equals_is_found() {
    let checks = quick(|trial| ties::run(trial, &sabotaged(last)));
    finds(&checks, "squares");
    finds(&checks, "shuffled");
}

/// A top level that normalises directions on their way into local space: t is another.
struct Normalizing(Tlas);

impl Tracer for Normalizing {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let hit = self.0.closest_hit(ray)?;
        let placement = &self.0.placements()[hit.instance as usize];
        let local = placement.local_from_world().transform_vector3(ray.direction.as_dvec3());
        Some(Hit { t: hit.t * local.length() as f32, ..hit })
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        self.0.any_hit(ray)
    }
}

#[test]
fn placements_that_round_or_stretch_are_found() {
    let normalizing: instances::Placer =
        ("normalizing".to_owned(), Box::new(|placements| Box::new(Normalizing(Tlas::build(placements)))));
    let checks = quick(|trial| instances::run(trial, &[normalizing]));
    finds(&checks, "flat mesh");
    finds(&checks, "each alone");
    // Placed a millionth larger or, mirrored, smaller.
    let placer: instances::Placer = (
        "larger".to_owned(),
        Box::new(|placements| {
            let larger = |p: &Placement| {
                let mut place = *p.world_from_local();
                place.matrix3 *= 1.0 + 1e-4 * p.world_from_local().matrix3.determinant().signum();
                Placement::new(std::sync::Arc::clone(p.blas()), place)
            };
            Box::new(Tlas::build(placements.iter().filter_map(larger).collect()))
        }),
    );
    finds(&quick(|trial| instances::run(trial, &[placer])), "mirrored");
    let lost: instances::Placer = ("lost".to_owned(), Box::new(|_| Box::new(Tlas::build(Vec::new()))));
    finds(&quick(|trial| instances::run(trial, &[lost])), "leaks");
    finds(&quick(|trial| instances::normals(trial, |matrix| matrix)), "normals of an ellipsoid, origin");
}
