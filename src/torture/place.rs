//! Where a case is tried: what has no absolute epsilon does not care.

use glam::{DAffine3, DVec3, Vec3};

/// Scaled about the origin, then moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Factor.
    pub scale: f64,
    /// Along each axis.
    pub shift: f64,
}

impl Place {
    /// As it is.
    pub const ORIGIN: Self = Self { scale: 1.0, shift: 0.0 };

    /// At the origin, at 1e3 and at 1e5, and a thousandth and a thousand times as large.
    pub const ALL: [Self; 5] = [
        Self::ORIGIN,
        Self { scale: 1.0, shift: 1e3 },
        Self { scale: 1.0, shift: 1e5 },
        Self { scale: 1e-3, shift: 0.0 },
        Self { scale: 1e3, shift: 0.0 },
    ];

    /// What a table calls it.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::ORIGIN => "origin".to_owned(),
            Self { scale: 1.0, shift } => format!("at {shift:+.0e}"),
            Self { scale, .. } => format!("times {scale:.0e}"),
        }
    }

    /// Where `p` is then, rounded once.
    #[must_use]
    pub fn point(self, p: Vec3) -> Vec3 {
        (p.as_dvec3() * self.scale + DVec3::splat(self.shift)).as_vec3()
    }

    /// The same as a transform.
    #[must_use]
    pub fn transform(self) -> DAffine3 {
        DAffine3::from_translation(DVec3::splat(self.shift)) * DAffine3::from_scale(DVec3::splat(self.scale))
    }
}
