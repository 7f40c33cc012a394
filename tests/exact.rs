//! Hit or miss, and where, against exact arithmetic.

use glam::Vec3;
use penumbra::bvh::{Blas, Ray};

/// pbrt-v4's `BadCases`: a triangle of area exactly 0.
#[test]
fn a_triangle_without_area_is_never_hit() {
    let triangle = [
        Vec3::new(-1113.4546, -79.049614, -56.24319),
        Vec3::new(-1113.4546, -87.09227, -56.24319),
        Vec3::new(-1113.4546, -79.209015, -56.24319),
    ];
    let ray = Ray {
        origin: Vec3::new(-1081.4792, 99.999954, 87.77011),
        direction: Vec3::new(-32.1073, -183.35587, -144.60764),
        t_max: 0.9999,
    };
    assert_eq!(Blas::build(&[triangle]).closest_hit(&ray), None);
}
