//! The structure itself: what checks it, refitting, threads.

#[path = "support/geometry.rs"]
mod geometry;

use geometry::{Rng, aimed_ray, boxes, brute_force, check, check_hierarchy, place, soup};
use glam::{DAffine3, Vec3};
use penumbra::bvh::inspect::Order;
use penumbra::bvh::wide::{Child, WIDTH};
use penumbra::bvh::{Aabb, Blas, Bvh, Defect, Node, Tlas, WideBvh};
use std::sync::Arc;

/// A square of 3200 triangles, none of them long or steep enough to be split.
fn wave() -> Vec<[Vec3; 3]> {
    (0..1600)
        .flat_map(|k| {
            let point = |di: usize, dj: usize| {
                let (x, z) = ((k % 40 + di) as f32 * 0.05 - 1.0, (k / 40 + dj) as f32 * 0.05 - 1.0);
                Vec3::new(x, 0.2 * (x * 9.0).sin() * (z * 7.0).cos(), z)
            };
            let [a, b, c, d] = [point(0, 0), point(1, 0), point(1, 1), point(0, 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

#[test]
fn a_refitted_hierarchy_hits_what_a_new_one_hits() {
    let triangles = wave();
    let blas = Blas::build(&triangles);
    let bend = |amount: f32| -> Vec<[Vec3; 3]> {
        triangles.iter().map(|t| t.map(|p| p + Vec3::Y * (p.x * 3.0).sin() * amount)).collect()
    };
    let mut rng = Rng(31);
    let mut refitted = blas.clone();
    for amount in [0.1, 0.2, 0.0] {
        let moved = bend(amount);
        refitted = refitted.refit(&moved).expect("bent a little");
        assert_eq!(check(&refitted, &moved), Ok(()));
        for _ in 0..1000 {
            let ray = aimed_ray(&mut rng, &moved, 2.0, Vec3::ZERO);
            assert_eq!(refitted.closest_hit(&ray), brute_force(&moved, &ray));
        }
    }
    assert_eq!(refitted.cost(), blas.cost(), "bent back");
    // Many small steps do not wear it out unseen.
    let apart = |step: usize| -> Vec<[Vec3; 3]> {
        let mut rng = Rng(5);
        triangles
            .iter()
            .map(|t| (t, rng.vec()))
            .map(|(t, v)| t.map(|p| p + v * 0.002 * step as f32))
            .collect()
    };
    assert!(blas.refit(&apart(1)).is_some());
    assert!((1..200).try_fold(blas.clone(), |blas, step| blas.refit(&apart(step))).is_none());
    assert!(blas.refit(&triangles[1..]).is_none(), "one is missing");
    let shuffled: Vec<_> = (0..3200).map(|i| triangles[i * 1237 % 3200]).collect();
    assert!(blas.refit(&shuffled).is_none(), "all are elsewhere");
    let mut without_place = triangles.clone();
    without_place[7][1].x = f32::NAN;
    assert!(blas.refit(&without_place).is_none());
    let mut collapsed = triangles.clone();
    collapsed[9] = [Vec3::ZERO; 3];
    assert!(Blas::build(&collapsed).refit(&triangles).is_none(), "one has come back");
    let mut line = triangles.clone();
    line[9][2] = line[9][1];
    assert!(blas.refit(&line).is_none(), "one has no surface any more");
}

#[test]
fn the_checker_finds_each_defect() {
    let triangles = soup(200, 0.2, 8);
    let boxes = boxes(&triangles);
    let good = Bvh::build(&boxes);
    assert_eq!(good.check(&boxes), Ok(()));
    let inner = good.nodes.iter().position(|n| n.count == 0).unwrap();
    let leaf = good.nodes.iter().position(|n| n.count > 0).unwrap();

    let mut broken = good.clone();
    broken.nodes[inner].max = broken.nodes[inner].min;
    assert!(matches!(broken.check(&boxes), Err(Defect::ChildOutsideParent { .. })));
    let mut broken = good.clone();
    broken.nodes[leaf].max = broken.nodes[leaf].min;
    assert!(matches!(broken.check(&boxes), Err(Defect::PrimOutsideLeaf { .. })));
    let mut broken = good.clone();
    broken.prims[1] = broken.prims[0];
    assert!(broken.check(&boxes).is_err());
    let mut broken = good.clone();
    broken.nodes[inner].first = 1 << 30;
    assert!(matches!(broken.check(&boxes), Err(Defect::Dangling { .. })));
    let mut broken = good;
    broken.nodes[leaf].count = 0;
    broken.nodes[leaf].first = 0;
    assert!(matches!(broken.check(&boxes), Err(Defect::Dangling { .. })), "no way back to the root");
}

#[test]
fn each_octant_has_an_order_of_all_children() {
    let dot = |center: Vec3| Aabb { min: center - 0.25, max: center + 0.25 };
    // Equal middles, both zeros, and two places without a child.
    let places = [Vec3::ZERO, Vec3::ZERO, -Vec3::X, Vec3::X, Vec3::Y, Vec3::splat(50.0)];
    let boxes = places.map(dot);
    let mut wide = WideBvh::new(&Bvh::build(&boxes), 1);
    assert_eq!(wide.check(Some(&boxes)), Ok(()));
    let node = &wide.nodes[0];
    let bounds: Vec<Aabb> = (0..WIDTH).map(|slot| node.child_bounds(slot)).collect();
    for octant in 0..8 {
        let sign = |axis: usize| if octant >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let diagonal = Vec3::new(sign(0), sign(1), sign(2));
        let order = (0..WIDTH).map(|i| &bounds[(node.orders[octant] >> (3 * i) & 7) as usize]);
        let along: Vec<f32> = order.filter(|b| !b.is_empty()).map(|b| b.center().dot(diagonal)).collect();
        assert_eq!(along.len(), boxes.len(), "they are not all in one node");
        assert!(along.is_sorted_by(|a, b| a >= b), "octant {octant}: {along:?} is not from far to near");
    }
    wide.nodes[0].orders[3] ^= 1;
    assert_eq!(wide.check(Some(&boxes)), Err(Defect::BadOrder { node: 0 }));
}

#[test]
fn the_checker_finds_a_path_longer_than_a_traversal_stack() {
    // A chain: node 2 i is inner, node 2 i − 1 a leaf of one box beside it.
    let chain = |levels: u32| {
        let (min, max) = (Vec3::ZERO, Vec3::ONE);
        let mut nodes = vec![Node { min, first: 1, max, count: 0 }];
        for level in 1..=levels {
            nodes.push(Node { min, first: level - 1, max, count: 1 });
            nodes.push(Node { min, first: 2 * level + 1, max, count: 0 });
        }
        *nodes.last_mut().unwrap() = Node { min, first: levels, max, count: 1 };
        Bvh { nodes, prims: (0..=levels).collect() }.check(&vec![Aabb { min, max }; levels as usize + 1])
    };
    assert_eq!(chain(20), Ok(()));
    assert!(matches!(chain(200), Err(Defect::TooDeep { .. })));
}

/// Triangles that lie anywhere, each with a box of its own, would need twice as many nodes.
#[test]
fn no_triangle_takes_more_than_72_bytes() {
    let needles = |count| {
        let mut rng = Rng(9);
        let needle = |_| {
            let (p, along) = (rng.vec(), rng.vec() * 0.2);
            [p, p + along, p + along + rng.vec() * 1e-3]
        };
        (0..count).map(needle).collect::<Vec<_>>()
    };
    // Then entries are about as many as can have corners of their own.
    let without_surface = |needles: Vec<[Vec3; 3]>| {
        let points = needles.iter().map(|needle| [needle[0]; 3]).collect::<Vec<_>>();
        [needles, points].concat()
    };
    for (name, triangles) in [
        ("dots", soup(50_000, 0.001, 5)),
        ("soup", soup(50_000, 0.05, 6)),
        ("dense", soup(100_000, 0.5, 7)),
        ("needles", needles(200_000)),
        ("few needles", needles(10_000)),
        ("small soup", soup(20_000, 0.5, 7)),
        ("half of it nothing", without_surface(needles(5000))),
    ] {
        let bytes = Blas::build(&triangles).bytes() as f64 / triangles.len() as f64;
        assert!(bytes <= 72.0, "{name}: {bytes} bytes a triangle");
        println!("{name}: {bytes:.1} bytes a triangle");
    }
}

#[test]
fn the_build_is_the_same_for_any_number_of_threads() {
    let boxes = boxes(&soup(50_000, 0.01, 6));
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Bvh::build(&boxes))
    };
    let (one, four) = (build(1), build(4));
    assert_eq!((one.nodes, one.prims), (four.nodes, four.prims));
}

/// Lists that are parted in pieces, for which the outermost centres are not looked up first.
#[test]
fn long_lists_keep_all_whatever_their_boxes_are_on_any_number_of_threads() {
    let count = 150_000;
    let dots = boxes(&soup(count, 0.01, 7));
    let around = |size: f32| {
        let mut rng = Rng(8);
        let box_at = move |center: Vec3| Aabb { min: center - size, max: center + size };
        (0..count).map(|_| box_at(rng.vec() * 0.01)).collect::<Vec<_>>()
    };
    let whole = |bound: f32| Aabb { min: Vec3::splat(-bound), max: Vec3::splat(bound) };
    let with = |outlier: Aabb| dots.iter().copied().chain([outlier]).collect::<Vec<_>>();
    // The sea around them: of its box's bins only those of heights would part the dots.
    let sea = Vec3::new(1e4, 1.0, 1e4);
    let (far, huge) = (with(Aabb { min: -sea, max: sea }), with(whole(3e38)));
    for (name, boxes) in [
        ("dots", &dots),
        ("far", &far),
        ("huge", &huge),
        ("equal", &vec![whole(1.0); count]),
        ("large", &around(10.0)),
    ] {
        let build = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Bvh::build(boxes))
        };
        let (one, three) = (build(1), build(3));
        assert_eq!(one.check(boxes), Ok(()), "{name}");
        assert!(one.nodes == three.nodes && one.prims == three.prims, "{name}");
    }
}

/// One thing far larger than all others, through whose box they can be parted along one axis only.
#[test]
fn a_sea_around_an_island_does_not_spoil_it() {
    // Areas of what is smaller than the sea.
    let cost = |boxes: &[Aabb]| {
        let area = |node: &Node| f64::from(Aabb { min: node.min, max: node.max }.half_area());
        Bvh::build(boxes).nodes.iter().map(area).filter(|&area| area < 1e4).sum::<f64>()
    };
    let mut rng = Rng(9);
    let dot = |p: Vec3| Vec3::new(p.x, 0.1 * (7.0 * p.x).sin() * (5.0 * p.z).cos(), p.z);
    let island: Vec<Aabb> = (0..600_000)
        .map(|_| dot(rng.vec()))
        .map(|center| Aabb { min: center - 1e-3, max: center + 1e-3 })
        .collect();
    for sea in [Vec3::new(1e4, 1.0, 1e4), Vec3::splat(1e15)] {
        let with_sea: Vec<Aabb> = island.iter().copied().chain([Aabb { min: -sea, max: sea }]).collect();
        let ratio = cost(&with_sea) / cost(&island);
        // 1.16 if long lists are not looked at again.
        assert!(ratio < 1.03, "{ratio} times the area with {sea}");
    }
}

/// Cuts `part` of the box of each leaf in turn away, along one axis.
fn shrunk(hierarchy: &WideBvh, part: f32) -> impl Iterator<Item = WideBvh> {
    let slots = (0..hierarchy.nodes.len()).flat_map(|node| (0..WIDTH).map(move |slot| (node, slot)));
    slots.enumerate().filter_map(move |(turn, (node, slot))| {
        let bounds = hierarchy.nodes[node].child_bounds(slot);
        let is_leaf = matches!(Child::unpack(hierarchy.nodes[node].children[slot]), Child::Leaf { .. });
        let axis = turn % 3;
        let shorter = bounds.max[axis] - part * (bounds.max[axis] - bounds.min[axis]);
        (is_leaf && !bounds.is_empty() && shorter < bounds.max[axis]).then(|| {
            let mut broken = hierarchy.clone();
            broken.nodes[node].bounds[axis][1][slot] = shorter;
            broken
        })
    })
}

#[test]
fn the_checker_finds_a_leaf_that_is_too_small() {
    // Of whole triangles every box is as small as can be.
    let whole = wave();
    let blas = Blas::build(&whole);
    assert_eq!(blas.hierarchy().prims.len(), whole.len(), "none was split");
    assert_eq!(check(&blas, &whole), Ok(()));
    for broken in shrunk(blas.hierarchy(), 0.01) {
        let found = check_hierarchy(&broken, &whole);
        assert!(found.as_ref().is_err_and(|why| why.contains("sticks out")), "{found:?}");
    }
    // Parts of a needle hold only their own points.
    let mut rng = Rng(4);
    let needles: Vec<[Vec3; 3]> = (0..3)
        .map(|_| {
            let across = rng.vec() * 0.1;
            [rng.vec() - Vec3::ONE * 50.0, Vec3::ONE * 50.0 + across, Vec3::ONE * 50.0 - across]
        })
        .collect();
    let blas = Blas::build(&needles);
    let parts = blas.hierarchy().prims.len();
    assert!((9..300).contains(&parts), "fewer parts than points: {parts}");
    assert_eq!(check(&blas, &needles), Ok(()));
    let (mut found, mut tried) = (0, 0);
    for broken in shrunk(blas.hierarchy(), 0.5) {
        found += usize::from(check_hierarchy(&broken, &needles).is_err());
        tried += 1;
    }
    println!("{parts} parts of 3 needles: {found} of {tried} shrunk leaves found by sampled points");
    assert!(found * 2 > tried, "{found} of {tried}");
}

#[test]
fn the_checker_finds_a_part_that_is_missing() {
    let needle = [[Vec3::splat(-50.0), Vec3::new(50.0, 50.1, 50.0), Vec3::new(50.0, 50.0, 50.1)]];
    let blas = Blas::build(&needle);
    assert_eq!(check(&blas, &needle), Ok(()));
    let parts = blas.hierarchy().prims.len();
    assert!((5..100).contains(&parts), "{parts}");
    let mut other = needle.to_vec();
    other.push(needle[0]);
    assert!(check(&blas, &other).is_err_and(|why| why.contains("is in no leaf")));
    for entry in 0..parts {
        let mut broken = blas.hierarchy().clone();
        Arc::make_mut(&mut broken.prims)[entry] = 1;
        assert!(check_hierarchy(&broken, &other).is_err(), "entry {entry}");
    }
    let mut broken = blas.hierarchy().clone();
    Arc::make_mut(&mut broken.prims)[0] = 7;
    assert!(check_hierarchy(&broken, &needle).is_err());
}

#[test]
fn a_ray_that_is_watched_hits_what_the_others_hit_in_any_order() {
    let triangles = soup(3000, 0.1, 77);
    let mut rng = Rng(78);
    let mut placements: Vec<_> = (0..6)
        .map(|_| DAffine3::from_rotation_translation(rng.rotation(), rng.vec().as_dvec3() * 2.0))
        .collect();
    placements.push(DAffine3::IDENTITY);
    placements.push(placements[0]);
    let tlas = Tlas::build(placements.iter().map(|&placement| place(&triangles, placement)).collect());
    let (mut stack, mut queue) = (0, 0);
    for _ in 0..2000 {
        let ray = aimed_ray(&mut rng, &triangles, 3.0, Vec3::ZERO);
        let wanted = tlas.closest_hit(&ray);
        let mut last = 0.0;
        let mut steps = 0;
        let (by_queue, visits) = tlas.inspect(&ray, Order::Queue, false, |step| {
            // All that is visited is nearer than the hit, each farther than the one before, as its parent is.
            assert!(step.near <= step.found && step.near >= last * 0.999 - 1e-4, "{step:?} after {last}");
            last = step.near.max(last);
            steps += 1;
        });
        assert_eq!(by_queue, wanted);
        assert!(steps > 0);
        queue += visits.boxes;
        let (by_stack, visits) = tlas.inspect(&ray, Order::NearFirst, false, |_| {});
        assert_eq!(by_stack, wanted);
        stack += visits.boxes;
        let (any, least) = tlas.inspect(&ray, Order::NearFirst, true, |_| {});
        assert_eq!(any.is_some(), wanted.is_some());
        assert!(least.triangles <= visits.triangles);
    }
    assert!(queue < stack, "a queue sees fewer boxes: {queue} of {stack}");
}
