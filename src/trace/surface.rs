//! A hit made ready for shading.

use super::TraceScene;
use super::bsdf::Bsdf;
use super::scene::{InstanceData, both_uvs, interpolate};
use super::warp::offset;
use crate::bvh::triangle::cross;
use crate::bvh::{Hit, Ray};
use glam::{DVec3, Vec2, Vec3, Vec4};

/// The place where a ray met a surface, in render space.
#[derive(Clone, Copy, Debug)]
pub struct Interaction {
    /// The point, from barycentrics: nearer to the triangle's plane than `origin + t · direction`.
    pub position: Vec3,
    /// Bound on how far off the plane a ray starting here may seem to be, in each axis.
    pub error: Vec3,
    /// Unit geometric normal on the side that the ray came from.
    pub geometric_normal: Vec3,
    /// Unit interpolated normal, of the same side; the geometric one where there is none. It may face
    /// away from the eye.
    pub normal: Vec3,
    /// Unit direction of growing u, of the same side, and in w the side of the bitangent w · (normal × tangent);
    /// zero if the mesh has none.
    pub tangent: Vec4,
    /// Unit direction back along the ray.
    pub wo: Vec3,
    /// Both sets of texture coordinates; zero if the mesh has none.
    pub uvs: [Vec2; 2],
    /// Vertex colour; white if the mesh has none.
    pub color: Vec4,
    /// The ray came from the front (counter-clockwise) side.
    pub front: bool,
    /// Where the smooth surface would be that the normals speak of, if it bulges out there and nothing is
    /// in between.
    pub lifted: Option<Vec3>,
}

/// The point of the triangle with these corners that `hit` is at.
fn barycentric(corners: &[DVec3; 3], hit: &Hit) -> DVec3 {
    let (u, v) = (f64::from(hit.u), f64::from(hit.v));
    corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v
}

/// 2⁻²⁴, the rounding unit of f32.
pub(super) const UNIT: f64 = 1.0 / (1 << 24) as f64;

impl Interaction {
    /// Looks up `hit` of `ray` on `instance`, placed by number `hit.instance`.
    #[must_use]
    pub fn new(scene: &TraceScene, instance: &InstanceData, hit: &Hit, ray: &Ray) -> Self {
        let mesh = &*instance.mesh;
        let mut at = Self::flat(scene, instance, hit, ray);
        if !mesh.normals.is_empty() && at.normal.dot(at.wo) > 0.0 {
            let world_from_local = scene.geometry.tlas.placements()[hit.instance as usize].world_from_local();
            let corners = mesh.corners(hit.triangle as usize).map(Vec3::as_dvec3);
            let indices = mesh.triangles[hit.triangle as usize];
            let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
            let local = barycentric(&corners, hit);
            let position = if scene.geometry.tlas.placements()[hit.instance as usize].is_identity() {
                local
            } else {
                world_from_local.transform_point3(local)
            };
            let side = if at.front { 1.0 } else { -1.0 };
            let smooth = [0, 1, 2].map(|i| {
                let normal = mesh.normals.get(indices[i] as usize).map_or(DVec3::ZERO, |n| n.as_dvec3());
                let away = position - world_from_local.transform_point3(corners[i]);
                let normal = (instance.normal_matrix * normal).normalize_or_zero() * side;
                (weights[i], away.as_vec3(), normal.as_vec3())
            });
            at.lifted = at.lift(scene, &smooth);
        }
        at
    }

    /// [`Interaction::new`] for who needs no light there: without `lifted`, which may cost a ray.
    #[must_use]
    pub fn flat(scene: &TraceScene, instance: &InstanceData, hit: &Hit, ray: &Ray) -> Self {
        let mesh = &*instance.mesh;
        let placement = &scene.geometry.tlas.placements()[hit.instance as usize];
        let corners = mesh.corners(hit.triangle as usize).map(Vec3::as_dvec3);
        let indices = mesh.triangles[hit.triangle as usize];
        let weights = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);

        // In double precision the point lies in the plane whatever the rounding of u and v.
        let local = barycentric(&corners, hit);
        let facet = cross(&corners).normalize_or(DVec3::Z);
        // Most things are where their mesh is.
        let (position, spread, facet) = if placement.is_identity() {
            (local, local.abs(), facet)
        } else {
            let world_from_local = placement.world_from_local();
            let m = world_from_local.matrix3;
            let spread = m.x_axis.abs() * local.x.abs()
                + m.y_axis.abs() * local.y.abs()
                + m.z_axis.abs() * local.z.abs();
            // The inverse transpose keeps sides, also under a mirroring placement.
            let facet = (instance.normal_matrix * facet).normalize_or(DVec3::Z);
            (world_from_local.transform_point3(local), spread, facet)
        };
        let facet = facet.as_vec3();
        // The next ray starts from the rounded point, and rounds again on its way into local space.
        let error = (position.abs() + spread) * (2.0 * UNIT);
        let front = facet.dot(ray.direction) < 0.0;
        let geometric_normal = if front { facet } else { -facet };

        let side = if front { 1.0 } else { -1.0 };
        let normal = interpolate(&mesh.normals, indices, weights)
            .and_then(|n: Vec3| (instance.normal_matrix * n.as_dvec3()).try_normalize())
            .map_or(geometric_normal, |n| n.as_vec3() * side);
        let tangent = interpolate(&mesh.tangents, indices, weights).map_or(Vec4::ZERO, |t: Vec4| {
            let matrix = placement.world_from_local().matrix3;
            // A mirroring placement turns the cross product of normal and tangent round.
            let w = t.w.signum() * matrix.determinant().signum() as f32;
            (matrix * t.truncate().as_dvec3())
                .try_normalize()
                .map_or(Vec4::ZERO, |t| (t.as_vec3() * side).extend(w * side))
        });
        Self {
            position: position.as_vec3(),
            error: error.as_vec3(),
            geometric_normal,
            normal,
            tangent,
            wo: -ray.direction.normalize(),
            uvs: both_uvs(mesh, indices, weights),
            color: interpolate(&mesh.colors, indices, weights).unwrap_or(Vec4::ONE),
            front,
            lifted: None,
        }
    }

    /// The point on the smooth surface: facets of a coarse mesh would shadow each other where its normals still
    /// see the light. `smooth`: weight, way from the corner to here, and normal of each corner.
    ///
    /// Reference: J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021, chapter 4. The ray that
    /// asks what is in between is ours: without it, light leaks around whatever is nearer than the lift.
    fn lift(&self, scene: &TraceScene, smooth: &[(f32, Vec3, Vec3); 3]) -> Option<Vec3> {
        if smooth.iter().all(|(_, _, normal)| normal.dot(self.geometric_normal) > 1.0 - 1e-6) {
            return None;
        }
        let lift: Vec3 = smooth
            .iter()
            .map(|&(weight, away, normal)| normal * (weight * (-away.dot(normal)).max(0.0)))
            .sum();
        if lift.dot(self.geometric_normal) <= 4.0 * self.error.dot(self.geometric_normal.abs()) {
            return None;
        }
        let origin = offset(self.position, self.error, self.geometric_normal);
        let ray = Ray { origin, direction: self.position + lift - origin, t_max: 1.0 };
        let is_clear = ray.direction != Vec3::ZERO && !scene.geometry.tlas.any_hit(&ray);
        is_clear.then_some(self.position + lift)
    }

    /// What decides whether a direction leaves the surface: the true normal, or where rays start from the smooth
    /// surface, that one's.
    #[must_use]
    pub fn side(&self) -> Vec3 {
        if self.lifted.is_some() { self.normal } else { self.geometric_normal }
    }

    /// Where a ray toward or from a light starts: as [`Interaction::origin_toward`], or from the smooth surface.
    #[must_use]
    pub fn lit_origin_toward(&self, direction: Vec3) -> Vec3 {
        match self.lifted {
            Some(lifted) if self.normal.dot(direction) > 0.0 => {
                offset(lifted, self.error, self.geometric_normal)
            }
            _ => self.origin_toward(direction),
        }
    }

    /// Where a ray that leaves toward `direction` starts: off the surface by just more than the
    /// rounding errors, so that it meets neither its own triangle nor leaps over a near one.
    ///
    /// Reference: M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering", 4th ed., 6.8.6.
    #[must_use]
    pub fn origin_toward(&self, direction: Vec3) -> Vec3 {
        let n = self.geometric_normal;
        offset(self.position, self.error, if n.dot(direction) < 0.0 { -n } else { n })
    }

    /// The surface's scattering here, seen from where the ray came.
    #[must_use]
    pub fn bsdf(&self, scene: &TraceScene, surface: &super::scene::Surface) -> Bsdf {
        Bsdf::new(scene, surface, self)
    }

    /// Radiance that the surface itself sends back along the ray.
    #[must_use]
    pub fn emission(&self, scene: &TraceScene, surface: &super::scene::Surface) -> Vec3 {
        let material = &surface.material;
        if material.emission == Vec3::ZERO || !(self.front || material.double_sided) {
            return Vec3::ZERO;
        }
        material.emission * scene.texture(surface.emission_texture, self.uvs).truncate()
    }
}
