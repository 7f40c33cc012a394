//! Ray and triangle in whole numbers: what is true of their floats, without any rounding.

use glam::{DVec3, Vec3, Vec3Swizzles};
use num_bigint::{BigInt, Sign};
use penumbra::bvh::Ray;

/// The truth, and how near it is to its opposite.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    /// The ray's line goes through the triangle, border included, and not in its plane.
    pub inside: bool,
    /// Where it meets the plane; no number if it is in the plane or parallel.
    pub t: f64,
    /// The same answer follows from edge functions with errors of 8 ε of their margin's measure.
    pub certain: bool,
    /// Of the determinant n · d: the sum of its products' sizes, compared with itself.
    pub condition: f64,
}

/// Vectors of whole numbers times a power of two.
type Whole = [BigInt; 3];

/// The exponent of the lowest bit that is set.
fn lowest_bit(x: f32) -> i32 {
    let (mantissa, exponent) = parts(x);
    if mantissa == 0 { i32::MAX } else { exponent + mantissa.trailing_zeros() as i32 }
}

/// |x| = mantissa · 2^exponent.
fn parts(x: f32) -> (u32, i32) {
    let (bits, fraction) = (x.to_bits() >> 23 & 0xff, x.to_bits() & 0x7f_ffff);
    if bits == 0 { (fraction, -149) } else { (fraction | 1 << 23, bits as i32 - 150) }
}

/// `x` · 2^-`unit`, which is whole.
fn whole(x: f32, unit: i32) -> BigInt {
    let (mantissa, exponent) = parts(x);
    let shifted = if exponent >= unit {
        BigInt::from(mantissa) << (exponent - unit) as u32
    } else {
        BigInt::from(mantissa >> (unit - exponent).min(31) as u32)
    };
    if x < 0.0 { -shifted } else { shifted }
}

/// To 53 bits or better.
fn float(x: &BigInt) -> f64 {
    let below = x.bits().saturating_sub(100);
    let top = i128::try_from(x >> below).unwrap();
    top as f64 * (below as f64).exp2()
}

/// To 53 bits or better.
fn quotient(x: &BigInt, y: &BigInt) -> f64 {
    let more = (y.bits() + 70).saturating_sub(x.bits());
    float(&((x << more) / y)) * (-(more as f64)).exp2()
}

fn subtract(p: &Whole, q: &Whole) -> Whole {
    [&p[0] - &q[0], &p[1] - &q[1], &p[2] - &q[2]]
}

fn cross(p: &Whole, q: &Whole) -> Whole {
    [0, 1, 2].map(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        &p[j] * &q[k] - &p[k] * &q[j]
    })
}

fn dot(p: &Whole, q: &Whole) -> BigInt {
    &p[0] * &q[0] + &p[1] * &q[1] + &p[2] * &q[2]
}

/// What is true of a ray and a triangle of finite floats.
///
/// Margins are measured as the triangle test computes (Woop et al. 2013): of corners p and q seen from the
/// origin, along the largest component z of the direction d, with s = d / `d_z`, an edge function is
/// (px - sx pz) (qy - sy qz) - (py - sy pz) (qx - sx qz). Its products' sizes are
/// (|px| + |sx pz|) (|qy| + |sy qz|) + (|py| + |sy pz|) (|qx| + |sx qz|).
pub fn truth(ray: &Ray, corners: &[Vec3; 3]) -> Truth {
    let unit_of = |points: &[Vec3]| points.iter().flat_map(Vec3::to_array).map(lowest_bit).min().unwrap();
    let unit = unit_of(&[ray.origin, corners[0], corners[1], corners[2]]).min(0);
    let step = unit_of(&[ray.direction]);
    let at = |p: Vec3, unit: i32| p.to_array().map(|x| whole(x, unit));
    let (origin, direction) = (at(ray.origin, unit), at(ray.direction, step));
    let seen = corners.map(|p| subtract(&at(p, unit), &origin));
    let [a, b, c] = &seen;
    let edges = [dot(&direction, &cross(c, b)), dot(&direction, &cross(a, c)), dot(&direction, &cross(b, a))];
    let normal = cross(&subtract(b, a), &subtract(c, a));
    let (along, height) = (dot(&normal, &direction), dot(&normal, a));
    let has = |sign: Sign| edges.iter().any(|e| e.sign() == sign);
    let parallel = along.sign() == Sign::NoSign;
    let inside = !(parallel || has(Sign::Plus) && has(Sign::Minus));
    let t = if parallel { f64::NAN } else { quotient(&height, &along) * f64::from(unit - step).exp2() };

    let scaled =
        |p: &Whole, unit: i32| DVec3::from_array([0, 1, 2].map(|i| float(&p[i]))) * f64::from(unit).exp2();
    let d = scaled(&direction, step);
    let z = if d.z.abs() > d.x.abs().max(d.y.abs()) { 2 } else { usize::from(d.y.abs() > d.x.abs()) };
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    let sizes = [0, 1, 2].map(|i| {
        let p = scaled(&seen[i], unit).abs();
        (p[x] + (d[x] / d[z]).abs() * p[z], p[y] + (d[y] / d[z]).abs() * p[z])
    });
    let to_edge = f64::from(2 * unit + step).exp2() / d[z].abs();
    let clear = [(2, 1), (0, 2), (1, 0)].iter().zip(&edges).map(|(&(p, q), edge)| {
        let (p, q) = (sizes[p], sizes[q]);
        let off = float(edge).abs() * to_edge > 8.0 * f64::from(f32::EPSILON) * (p.0 * q.1 + p.1 * q.0);
        if off { edge.sign() } else { Sign::NoSign }
    });
    let clear: Vec<Sign> = clear.collect();
    let a = scaled(&seen[0], unit);
    let (e, f) = (scaled(&subtract(&seen[1], &seen[0]), unit), scaled(&subtract(&seen[2], &seen[0]), unit));
    let normal_size = e.abs().yzx() * f.abs().zxy() + e.abs().zxy() * f.abs().yzx();
    let height_off = 8.0 * f64::from(f32::EPSILON) * normal_size.dot(a.abs());
    let in_front = float(&height).abs() * f64::from(3 * unit).exp2() > height_off;
    let certain = if inside {
        !clear.contains(&Sign::NoSign) && in_front
    } else {
        clear.contains(&Sign::Plus) && clear.contains(&Sign::Minus)
    };
    let condition = normal_size.dot(d.abs()) / (float(&along).abs() * f64::from(2 * unit + step).exp2());
    Truth { inside, t, certain, condition }
}
