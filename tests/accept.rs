//! Only hits in instances that ask for it are asked about.

use glam::{DAffine3, DVec3, Vec3};
use penumbra::bvh::{Accept, Blas, Hit, Isa, Placement, Ray, Tlas};
use std::cell::RefCell;
use std::sync::Arc;

/// Refuses everything in instance 0, and writes down what it was asked about.
#[derive(Default)]
struct Refuse {
    asked: RefCell<Vec<u32>>,
    asks_everywhere: bool,
}

impl Accept for Refuse {
    fn asks(&self, instance: u32) -> bool {
        self.asks_everywhere || instance == 0
    }
    fn takes(&self, _: usize, hit: &Hit) -> bool {
        self.asked.borrow_mut().push(hit.instance);
        hit.instance != 0
    }
}

/// Three walls one behind the other, and rays across them: some alone, some in packets.
fn walls() -> (Tlas, Vec<Ray>) {
    let wall = [
        [Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, -9.0, 0.0), Vec3::new(9.0, 9.0, 0.0)],
        [Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, 9.0, 0.0), Vec3::new(-9.0, 9.0, 0.0)],
    ];
    let blas = Arc::new(Blas::build(&wall));
    let placements = (0..3)
        .map(|i| {
            let at = DVec3::Z * f64::from(i);
            Placement::new(Arc::clone(&blas), DAffine3::from_translation(at)).unwrap()
        })
        .collect();
    let rays = (0..300)
        .map(|i| {
            let direction = if i % 40 == 0 { Vec3::new(0.1, -0.2, 0.9) } else { Vec3::new(0.1, 0.2, 1.0) };
            Ray::new(Vec3::new(i as f32 * 0.01, 0.0, -1.0), direction)
        })
        .collect();
    (Tlas::build(placements), rays)
}

#[test]
fn hits_are_asked_about_only_in_instances_that_want_it() {
    let (tlas, rays) = walls();
    for isa in Isa::available() {
        let tlas = tlas.clone().with_isa(isa);
        let accept = Refuse::default();
        let mut hits = vec![None; rays.len()];
        tlas.closest_hits(&rays, &mut hits, Some(&accept));
        assert!(hits.iter().all(|hit| hit.is_some_and(|hit: Hit| hit.instance == 1)), "{}", isa.name());
        let mut blocked = vec![false; rays.len()];
        tlas.any_hits(&rays, &mut blocked, Some(&accept));
        assert!(blocked.iter().all(|&b| b), "{}", isa.name());
        let asked = accept.asked.take();
        assert!(!asked.is_empty() && asked.iter().all(|&instance| instance == 0), "{}", isa.name());

        let everywhere = Refuse { asks_everywhere: true, ..Refuse::default() };
        tlas.closest_hits(&rays, &mut hits, Some(&everywhere));
        assert!(everywhere.asked.take().contains(&1), "the test above can fail");
    }
}
