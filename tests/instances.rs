//! Placed meshes of files. (Of others: case G11 of `torture`.)

#[path = "support/geometry.rs"]
mod geometry;

use geometry::{Rng, place, scenes, shared};
use glam::{DAffine3, DVec3, Vec3};
use penumbra::bvh::{Aabb, Blas, Hit, Isa, Placement, Ray, Tlas};
use penumbra::scene::TriangleMesh;
use std::collections::HashMap;
use std::sync::Arc;

#[test]
fn a_singular_placement_is_refused() {
    let blas = Arc::new(Blas::build(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]));
    assert!(Placement::new(Arc::clone(&blas), DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0))).is_none());
    assert!(Placement::new(blas, DAffine3::from_translation(DVec3::splat(f64::NAN))).is_none());
}

#[test]
fn nothing_is_hit_where_there_is_nothing() {
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert_eq!(Blas::build(&[]).closest_hit(&ray), None);
    assert_eq!(Tlas::build(Vec::new()).closest_hit(&ray), None);
    assert!(!Tlas::build(vec![place(&[], DAffine3::IDENTITY)]).any_hit(&ray));
}

/// A mesh far from its own origin that is brought back to the world's: rounding its ray in local space moves it by a thousand times
/// the world's own rounding. The top level must not be stricter than what is below it.
#[test]
fn meshes_far_from_their_origin_are_not_missed_by_their_boxes() {
    for far in [1e3, 1e5, 1e6f32] {
        let tile = |x: f32| {
            let [a, b] = [Vec3::new(x, far, -1.0), Vec3::new(x, far, 1.0)];
            let [c, d] = [Vec3::new(x + 1.0, far, 1.0), Vec3::new(x + 1.0, far, -1.0)];
            place(&[[a, b, c], [a, c, d]], DAffine3::from_translation(DVec3::Y * -f64::from(far)))
        };
        let tiles = [tile(0.0), tile(1.0)];
        let tlas = Tlas::build(tiles.to_vec());
        let mut rng = Rng(7);
        let mut hits = 0;
        let grazing: Vec<Ray> = (0..20_000)
            .map(|_| {
                let target = Vec3::new(1.0 + rng.vec().x * 0.1, 0.0, rng.vec().z * 0.9);
                // A few steps of the floats there above the tiles.
                let origin = Vec3::new(-1.0, rng.vec().y * far * 3e-6, target.z);
                Ray::new(origin, target - origin)
            })
            .collect();
        for (ray, found) in grazing.iter().zip(closest_hits(&tlas, &grazing)) {
            let below = tiles.iter().filter_map(|tile| {
                let inverse = tile.local_from_world();
                let local = Ray {
                    origin: inverse.transform_point3(ray.origin.as_dvec3()).as_vec3(),
                    direction: inverse.transform_vector3(ray.direction.as_dvec3()).as_vec3(),
                    t_max: ray.t_max,
                };
                tile.blas().closest_hit(&local)
            });
            let nearest = below.map(|hit| hit.t).min_by(f32::total_cmp);
            assert_eq!(found.map(|hit| hit.t), nearest, "{far}: {ray:?}");
            hits += usize::from(nearest.is_some());
        }
        assert!(hits > 1000, "{far}: {hits}");
    }
}

/// A file's instances as a top level; those that are flat have no surface.
fn tlas_of(meshes: &[(Arc<TriangleMesh>, DAffine3)], also: DAffine3) -> Tlas {
    let mut built: HashMap<*const TriangleMesh, Arc<Blas>> = HashMap::new();
    let placements = meshes.iter().filter_map(|(mesh, place)| {
        let blas = built.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
            let corners: Vec<_> = (0..mesh.triangles.len()).map(|i| mesh.corners(i)).collect();
            Arc::new(Blas::build(&corners))
        });
        Placement::new(Arc::clone(blas), also * *place)
    });
    Tlas::build(placements.collect())
}

fn closest_hits(tlas: &Tlas, rays: &[Ray]) -> Vec<Option<Hit>> {
    let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    tlas.closest_hits(rays, &mut hits, None);
    tlas.any_hits(rays, &mut blocked, None);
    for (i, hit) in hits.iter().enumerate() {
        assert_eq!(blocked[i], hit.is_some(), "any-hit: {:?}", rays[i]);
    }
    hits
}

/// Rays from around `bounds` to points inside.
fn rays_into(bounds: &Aabb, count: usize) -> Vec<Ray> {
    let mut rng = Rng(13);
    let half = bounds.max * 0.5 - bounds.min * 0.5;
    let ray = |_| {
        let target = bounds.center() + rng.vec() * half;
        let origin = bounds.center() + rng.direction() * half.length() * 2.0;
        Ray::new(origin, target - origin)
    };
    (0..count).map(ray).collect()
}

/// The mirror image of a scene is hit by the mirror images of rays at the same t, bit for bit: floats have a sign,
/// and nothing else changes.
#[test]
fn a_mirrored_scene_is_the_mirror_image() {
    let Some(shared) = shared("a_mirrored_scene_is_the_mirror_image") else {
        return;
    };
    for file in [
        "scenes/gltf/SpheresScaledInstances/spheres_scaled_instances.gltf",
        "scenes/gltf/PalmTree/PalmTree.gltf",
        "bad-input/own/scale_negative.gltf",
    ] {
        let meshes = scenes::placed_meshes(&shared.join(file));
        let tlas = tlas_of(&meshes, DAffine3::IDENTITY);
        let rays = rays_into(&tlas.bounds(), 20_000);
        for axis in 0..3 {
            let mut mirror = Vec3::ONE;
            mirror[axis] = -1.0;
            let mirrored = tlas_of(&meshes, DAffine3::from_scale(mirror.as_dvec3()));
            let images: Vec<Ray> = rays
                .iter()
                .map(|ray| Ray { origin: ray.origin * mirror, direction: ray.direction * mirror, ..*ray })
                .collect();
            for isa in Isa::available() {
                let hits = closest_hits(&tlas.clone().with_isa(isa), &rays);
                assert!(hits.iter().flatten().count() > 1000, "{file}");
                let images_hits = closest_hits(&mirrored.clone().with_isa(isa), &images);
                for ((hit, image), ray) in hits.iter().zip(&images_hits).zip(&rays) {
                    assert_eq!(hit, image, "{file}, axis {axis}, {}: {ray:?}", isa.name());
                }
            }
        }
    }
}

/// The depths of a machine of instances, and of all its triangles in one mesh, where they are placed: within 4 ulp and
/// a millionth of the size. Measured across the surface: rounding moves the corners of the flat mesh, and along a
/// ray that grazes a triangle that is farther. How many rays differ by more along themselves is printed (4 of 80,000).
///
/// Where one shows another part than the other, or nothing, the ray passes a silhouette: one that is moved by
/// as much as corners are rounded shows the same.
#[test]
fn an_engine_of_instances_equals_its_flat_mesh() {
    let Some(shared) = shared("an_engine_of_instances_equals_its_flat_mesh") else {
        return;
    };
    let file = shared.join("scenes/gltf/TwoCylinderEngine.glb");
    let instanced = tlas_of(&scenes::placed_meshes(&file), DAffine3::IDENTITY);
    let triangles = scenes::triangles(&file);
    let flat = Blas::build(&triangles);
    let bounds = flat.bounds();
    let size = (bounds.max - bounds.min).max_element();
    let mut rays = rays_into(&bounds, 40_000);
    // And a picture of 200 × 200 pixels.
    let eye = bounds.center() + Vec3::new(0.7, 0.5, 0.9) * size * 1.5;
    let forward = bounds.center() - eye;
    let (right, up) = (forward.cross(Vec3::Y).normalize(), Vec3::Y);
    rays.extend((0..40_000).map(|i| {
        let (x, y) = ((i % 200) as f32 / 100.0 - 1.0, (i / 200) as f32 / 100.0 - 1.0);
        Ray::new(eye, (forward + (right * x + up * y) * size * 0.6).normalize())
    }));
    for isa in Isa::available() {
        let (instanced, flat) = (instanced.clone().with_isa(isa), flat.clone().with_isa(isa));
        let hits = closest_hits(&instanced, &rays);
        let mut flat_hits = vec![None; rays.len()];
        flat.closest_hits(&rays, &mut flat_hits);
        // Along the ray, or across the triangle of the flat mesh.
        let near = |ray: &Ray, a: Option<Hit>, b: Option<Hit>, across: bool| match (a, b) {
            (Some(a), Some(b)) => {
                let length = ray.direction.length();
                let [p, q, r] = triangles[b.triangle as usize].map(Vec3::as_dvec3);
                let normal = (q - p).cross(r - p).normalize().as_vec3();
                let slope = if across { normal.dot(ray.direction).abs() / length } else { 1.0 };
                let step = (a.t.next_up() - a.t) * length;
                (a.t - b.t).abs() * length * slope <= 4.0 * step + 1e-6 * size
            }
            (None, None) => true,
            _ => false,
        };
        let same = |ray: &Ray, a: Option<Hit>, b: Option<Hit>| near(ray, a, b, true);
        let pairs = rays.iter().zip(&hits).zip(&flat_hits);
        let grazing =
            pairs.filter(|&((ray, &a), &b)| near(ray, a, b, true) && !near(ray, a, b, false)).count();
        let (mut silhouettes, mut wrong) = (0, 0);
        for ((ray, &hit), &flat_hit) in rays.iter().zip(&hits).zip(&flat_hits) {
            if same(ray, hit, flat_hit) {
                continue;
            }
            silhouettes += 1;
            let explained = (0..27).any(|i| {
                let by = Vec3::new((i % 3) as f32 - 1.0, (i / 3 % 3) as f32 - 1.0, (i / 9) as f32 - 1.0);
                let moved = Ray { origin: ray.origin + by * (1e-6 * size), ..*ray };
                same(ray, hit, flat.closest_hit(&moved)) || same(ray, instanced.closest_hit(&moved), flat_hit)
            });
            if !explained {
                wrong += 1;
                println!("{ray:?}: {hit:?}, flat {flat_hit:?}");
            }
        }
        let seen = hits.iter().flatten().count();
        println!(
            "{}: {seen} of {} rays hit, {silhouettes} at silhouettes, {grazing} graze",
            isa.name(),
            rays.len()
        );
        assert!(seen > rays.len() / 8 && silhouettes * 500 < seen && grazing * 2000 < seen);
        assert_eq!(wrong, 0, "{}", isa.name());
    }
}
