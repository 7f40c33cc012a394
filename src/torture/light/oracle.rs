//! Closed forms of irradiance, for lights of radiance 1, in double precision.

use glam::DVec3;
use std::f64::consts::PI;

/// What of a polygon is above the horizon of `normal` at `point`.
///
/// Reference: I. E. Sutherland, G. W. Hodgman, "Reentrant Polygon Clipping", CACM 17(1), 1974.
#[must_use]
pub fn above_horizon(corners: &[DVec3], point: DVec3, normal: DVec3) -> Vec<DVec3> {
    let height = |p: DVec3| (p - point).dot(normal);
    let mut above = Vec::with_capacity(corners.len() + 2);
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let (ha, hb) = (height(a), height(b));
        if ha >= 0.0 {
            above.push(a);
        }
        if (ha > 0.0 && hb < 0.0) || (ha < 0.0 && hb > 0.0) {
            above.push(a + (b - a) * (ha / (ha - hb)));
        }
    }
    above
}

/// Irradiance at `point` with unit `normal` from a flat polygon, whichever its side.
///
/// Reference: J. H. Lambert, "Photometria", 1760; by arctangents, which hold for small angles too.
#[must_use]
pub fn polygon(corners: &[DVec3], point: DVec3, normal: DVec3) -> f64 {
    0.5 * edges(&above_horizon(corners, point, normal), point, normal)
        .map(|(part, _)| part)
        .sum::<f64>()
        .abs()
}

/// The same without regard to the horizon: what many forget.
#[must_use]
pub fn unclipped_polygon(corners: &[DVec3], point: DVec3, normal: DVec3) -> f64 {
    0.5 * edges(corners, point, normal).map(|(part, _)| part).sum::<f64>().abs()
}

/// How large the numbers are whose sum [`polygon`] is: what one rounding in each of them may change it by, in
/// rounding units.
#[must_use]
pub fn polygon_condition(corners: &[DVec3], point: DVec3, normal: DVec3) -> f64 {
    0.5 * edges(&above_horizon(corners, point, normal), point, normal).map(|(_, size)| size).sum::<f64>()
}

/// Of each edge n · Γ, and what its cross product is made of: |d| |e| θ / |d × e|.
fn edges(corners: &[DVec3], point: DVec3, normal: DVec3) -> impl Iterator<Item = (f64, f64)> {
    (0..corners.len()).map(move |i| {
        let (a, b) = (corners[i] - point, corners[(i + 1) % corners.len()] - point);
        let cross = a.cross(b);
        let sine = cross.length();
        if sine == 0.0 {
            return (0.0, 0.0);
        }
        let angle = sine.atan2(a.dot(b));
        (angle * normal.dot(cross) / sine, angle * a.length() * (b - a).length() / sine)
    })
}

/// Irradiance from a ball of radius `r` whose middle is `to` away, above the horizon or cut by it.
///
/// Reference: A. B. Lagarde, C. de Rousiers, "Moving Frostbite to Physically Based Rendering", 2014, 4.7.2 (after
/// J. M. Snyder, "Area Light Sources for Real-Time Graphics", 1996).
#[must_use]
pub fn ball(r: f64, to: DVec3, normal: DVec3) -> f64 {
    let d = to.length();
    if d <= r {
        return PI;
    }
    let (sin, cos) = (r / d, (to.dot(normal) / d).clamp(-1.0, 1.0));
    let angle = cos.acos();
    if angle <= sin.acos() {
        return PI * sin * sin * cos;
    }
    if angle >= PI - sin.acos() {
        return 0.0;
    }
    let x = (1.0 / (sin * sin) - 1.0).sqrt();
    let y = -x * cos / angle.sin();
    let k = angle.sin() * (1.0 - y * y).sqrt();
    (cos * y.acos() - x * k) * sin * sin + (k / x).atan()
}

/// Irradiance from a disk of radius `r`, parallel to the receiver at height `h`, its middle `a` aside.
///
/// Reference: J. R. Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-13.
#[must_use]
pub fn disk(r: f64, h: f64, a: f64) -> f64 {
    let z = h * h + a * a;
    // 1 − (z − r²) / √…, with less cancellation.
    let root = ((z + r * r).powi(2) - 4.0 * r * r * a * a).sqrt();
    PI / 2.0 * (root - (z - r * r)) / root
}

/// How a line shines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// The same in all directions.
    Isotropic,
    /// With the sine of the angle to its axis.
    Sine,
}

/// Irradiance from a line of strength 1 per length between `a` and `b`, all of it above the horizon.
#[must_use]
pub fn line(a: DVec3, b: DVec3, point: DVec3, normal: DVec3, kind: Line) -> f64 {
    let (a, b) = (a - point, b - point);
    let axis = (b - a).normalize();
    let (s0, s1) = (a.dot(axis), b.dot(axis));
    let foot = a - axis * s0;
    let d2 = foot.length_squared();
    let (d, up, along) = (d2.sqrt(), foot.dot(normal), axis.dot(normal));
    let integral = |s: f64| match kind {
        Line::Isotropic => (up * s / d2 - along) / (d2 + s * s).sqrt(),
        Line::Sine => {
            let arc = s / (2.0 * d2 * (d2 + s * s)) + (s / d).atan() / (2.0 * d2 * d);
            up * d * arc - along * d / (2.0 * (d2 + s * s))
        }
    };
    integral(s1) - integral(s0)
}

/// Form factor of two parallel unit squares at distance 1.
#[must_use]
pub fn parallel_squares() -> f64 {
    let root = 2f64.sqrt();
    2.0 / PI * ((4.0f64 / 3.0).sqrt().ln() + 2.0 * root * (1.0 / root).atan() - 2.0 * 1f64.atan())
}

/// Form factor of two perpendicular unit squares with a common edge.
#[must_use]
pub fn perpendicular_squares() -> f64 {
    let root = 2f64.sqrt();
    1.0 / PI * (2.0 * 1f64.atan() - root * (1.0 / root).atan() + 0.25 * 0.75f64.ln())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Midpoint rule over a parallelogram.
    fn counted(corner: DVec3, u: DVec3, v: DVec3, point: DVec3, normal: DVec3) -> f64 {
        let n = 1000;
        let (side, mut sum) = (u.cross(v), 0.0);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
            let d = corner + u * at(i) + v * at(j) - point;
            sum += d.dot(normal).max(0.0) * d.dot(side).abs() / d.length_squared().powi(2);
        }
        sum / f64::from(n * n)
    }

    #[test]
    fn a_polygon_is_what_counting_says() {
        let v = DVec3::new;
        for (corner, e, f, point, normal) in [
            (v(-0.5, -0.5, 1.0), DVec3::X, DVec3::Y, DVec3::ZERO, DVec3::Z),
            (v(2.0, -1.0, -1.0), DVec3::Y * 2.0, DVec3::Z * 2.0, DVec3::ZERO, DVec3::Z),
            (v(0.3, 0.1, 0.4), v(1.0, 0.2, 0.3), v(-0.2, 1.0, 0.1), v(0.1, 0.0, 0.0), v(0.0, 0.6, 0.8)),
        ] {
            let corners = [corner, corner + e, corner + e + f, corner + f];
            let (exact, counted) = (polygon(&corners, point, normal), counted(corner, e, f, point, normal));
            assert!((exact / counted - 1.0).abs() < 1e-5, "{exact} {counted}");
        }
        let cut = [v(2.0, -1.0, -1.0), v(2.0, 1.0, -1.0), v(2.0, 1.0, 1.0), v(2.0, -1.0, 1.0)];
        assert!((polygon(&cut, DVec3::ZERO, DVec3::Z) - 0.0875102647738).abs() < 1e-12);
        assert!(unclipped_polygon(&cut, DVec3::ZERO, DVec3::Z) < 1e-15);
    }

    #[test]
    fn tabled_figures_come_out() {
        let v = DVec3::new;
        for (angle, exact) in
            [(0.0, PI / 4.0), (1.0, 0.424352438708), (PI / 2.0, 0.0905860737061), (1.8f64, 0.0237033624341)]
        {
            let to = v(angle.sin(), 0.0, angle.cos()) * 2.0;
            assert!((ball(1.0, to, DVec3::Z) - exact).abs() < 1e-11);
        }
        let (a, b) = (v(-1.5, 0.0, 2.0), v(1.5, 0.5, 3.0));
        for (point, isotropic, sine) in [
            (v(2.0, 1.0, 0.0), 0.221261776613, 0.207472175588),
            (v(1.0, -3.0, 0.0), 0.0991969298954, 0.0966847701406),
        ] {
            assert!((line(a, b, point, DVec3::Z, Line::Isotropic) - isotropic).abs() < 1e-12);
            assert!((line(a, b, point, DVec3::Z, Line::Sine) - sine).abs() < 1e-12);
        }
        assert!((parallel_squares() - 0.199824895698).abs() < 1e-12);
        assert!((parallel_squares() + 4.0 * perpendicular_squares() - 1.0).abs() < 1e-14);
    }
}
