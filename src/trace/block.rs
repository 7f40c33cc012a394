//! Surface points side by side, and what is computed for many of them at once.
//!
//! The kernels here are plain loops over rows of [`LANES`] numbers, which the compiler makes vectors of; [`Isa::run`]
//! compiles them for each instruction set. They do the same operations in all of them, so all give the same bits.

use super::light::error_of;
use super::quad::{Place, Quad};
use super::sampler::{Sampler, SamplerRow};
use super::surface::{Interaction, UNIT};
use super::warp::{cosine_hemisphere, offset};
use crate::bvh::Isa;
use crate::bvh::simd::{Job, Simd};
use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};
use std::f32::consts::PI;
use std::ops::Range;

/// Points in a block.
pub const LANES: usize = 64;

/// One number of each point.
pub type Row = [f32; LANES];

/// Three rows, x, y and z or red, green and blue.
#[derive(Clone, Debug)]
pub struct Rows(pub [Row; 3]);

impl Rows {
    /// Zeros.
    #[inline(always)]
    #[must_use]
    pub fn blank() -> Self {
        Self([[0.0; LANES]; 3])
    }

    /// Those of one point.
    #[inline(always)]
    #[must_use]
    pub fn get(&self, i: usize) -> Vec3 {
        Vec3::new(self.0[0][i], self.0[1][i], self.0[2][i])
    }

    /// Changes those of one point.
    #[inline(always)]
    pub fn set(&mut self, i: usize, value: Vec3) {
        self.0[0][i] = value.x;
        self.0[1][i] = value.y;
        self.0[2][i] = value.z;
    }
}

/// Up to [`LANES`] points where paths met surfaces that only reflect evenly (Lambert).
#[derive(Clone, Debug)]
pub struct Block {
    /// How many are there. What is beyond may be anything.
    pub count: usize,
    /// Which of the wave's paths.
    pub paths: [u32; LANES],
    /// See [`super::sightlines::Sightlines::of`].
    pub known: [Option<u32>; LANES],
    /// Of the triangle; only in a block that is [`Block::find_points`].
    pub corners: [Rows; 3],
    /// Barycentric weights of the second corner (x), the third (y); z is not used.
    pub weights: Rows,
    /// Of the ray that came here.
    pub direction: Rows,
    /// What light scattered here is worth at the eye: albedo and all that came before.
    pub throughput: Rows,
    /// See [`Interaction`].
    pub position: Rows,
    /// See [`Interaction`].
    pub geometric_normal: Rows,
    /// See [`Interaction`].
    pub normal: Rows,
    /// Where rays on this side start.
    pub origin: Rows,
    /// Random numbers.
    pub samplers: SamplerRow<LANES>,
}

/// What a light brings to each point of a block, before the shadow test.
#[derive(Clone, Debug)]
pub struct Arrivals {
    /// At the eye.
    pub contribution: Rows,
    /// Where on the light it comes from.
    pub target: Rows,
    /// That is all it brings: nothing is left to be tested.
    pub certain: [bool; LANES],
    /// The light is so near that this sample will not do.
    pub near: [bool; LANES],
}

impl Default for Arrivals {
    fn default() -> Self {
        Self {
            contribution: Rows::blank(),
            target: Rows::blank(),
            certain: [false; LANES],
            near: [false; LANES],
        }
    }
}

/// Where paths go on.
#[derive(Clone, Debug)]
pub struct Departures {
    /// Unit directions.
    pub direction: Rows,
    /// Their densities in solid angle; 0 where the path ends.
    pub pdf: Row,
}

impl Default for Departures {
    fn default() -> Self {
        Self { direction: Rows::blank(), pdf: [0.0; LANES] }
    }
}

impl Block {
    /// An empty one.
    #[must_use]
    pub fn new(like: Sampler) -> Self {
        let blank = Rows::blank;
        Self {
            count: 0,
            paths: [0; LANES],
            known: [None; LANES],
            corners: [blank(), blank(), blank()],
            weights: blank(),
            direction: blank(),
            throughput: blank(),
            position: blank(),
            geometric_normal: blank(),
            normal: blank(),
            origin: blank(),
            samplers: SamplerRow::new(like),
        }
    }

    /// Puts a point that is already known into its place.
    pub fn set_point(&mut self, i: usize, at: &Interaction) {
        self.position.set(i, at.position);
        self.geometric_normal.set(i, at.side());
        self.normal.set(i, at.normal);
        self.origin.set(i, at.lit_origin_toward(at.geometric_normal));
        if at.lifted.is_some() {
            // What is known holds for points on the triangle.
            self.known[i] = None;
        }
    }

    /// The points on flat triangles in these lanes: what [`Interaction::new`] does. `placed`: where the one instance is that they
    /// are on; `None` if its mesh is there already.
    pub fn find_points(&mut self, isa: Isa, lanes: Range<usize>, placed: Option<&Placed>) {
        match placed {
            None => isa.run(FindPoints(self, lanes)),
            Some(placed) => isa.run(FindPlaced(self, lanes, placed)),
        }
    }
}

/// Where an instance is.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Of points.
    pub world_from_local: DAffine3,
    /// Of normals, up to their length.
    pub normal_matrix: DMat3,
}

struct FindPoints<'a>(&'a mut Block, Range<usize>);

impl Job for FindPoints<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self(block, lanes) = self;
        for i in lanes {
            let (position, cross) = on_triangle(block, i);
            let error = (position.abs() * (4.0 * UNIT)).as_vec3();
            set_found(block, i, position, unit(cross), error);
        }
    }
}

struct FindPlaced<'a>(&'a mut Block, Range<usize>, &'a Placed);

impl Job for FindPlaced<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self(block, lanes, placed) = self;
        let m = placed.world_from_local.matrix3;
        let (x, y, z) = (m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
        for i in lanes {
            let (local, cross) = on_triangle(block, i);
            let spread = x * local.x.abs() + y * local.y.abs() + z * local.z.abs();
            let position = placed.world_from_local.transform_point3(local);
            let error = ((position.abs() + spread) * (2.0 * UNIT)).as_vec3();
            set_found(block, i, position, unit(placed.normal_matrix * unit(cross)), error);
        }
    }
}

/// Of length 1; +z if it has none.
#[inline(always)]
fn unit(v: DVec3) -> DVec3 {
    let scale = 1.0 / v.length();
    let is_right = (scale > 0.0) & (scale < f64::INFINITY);
    DVec3::select(glam::BVec3::splat(is_right), v * scale, DVec3::Z)
}

/// The point in the space of its mesh, and the triangle's normal, of any length: of two edges that no needle was asked about, for
/// [`crate::bvh::triangle::cross`] costs up to 5 % of all that is drawn here.
#[inline(always)]
fn on_triangle(block: &Block, i: usize) -> (DVec3, DVec3) {
    let a = block.corners[0].get(i).as_dvec3();
    let b = block.corners[1].get(i).as_dvec3();
    let c = block.corners[2].get(i).as_dvec3();
    let (u, v) = (f64::from(block.weights.0[0][i]), f64::from(block.weights.0[1][i]));
    (a * (1.0 - u - v) + b * u + c * v, (b - a).cross(c - a))
}

#[inline(always)]
fn set_found(block: &mut Block, i: usize, position: DVec3, facet: DVec3, error: Vec3) {
    let facet = facet.as_vec3();
    let front = facet.dot(block.direction.get(i)) < 0.0;
    let normal = Vec3::select(glam::BVec3::splat(front), facet, -facet);
    let position = position.as_vec3();
    block.position.set(i, position);
    block.geometric_normal.set(i, normal);
    block.normal.set(i, normal);
    block.origin.set(i, offset(position, error, normal));
}

/// One sample of a parallelogram light for each point that is not `certain` yet; those that it is `near` need another. By
/// nearly what places bring if `PRODUCT`, else evenly: decided when compiled, for it would be asked at each point.
pub struct SampleQuad<'a, const PRODUCT: bool> {
    /// The points.
    pub block: &'a Block,
    /// Random numbers.
    pub samplers: &'a SamplerRow<LANES>,
    /// The light.
    pub quad: &'a Quad,
    /// Radiance at its corners.
    pub radiance: &'a [Vec3; 4],
    /// Whether it emits to both sides.
    pub two_sided: bool,
    /// Which pair of random numbers.
    pub dimension: u32,
    /// How many such samples are taken of each point.
    pub members: f32,
    /// Whether bounces may find the light too, and share it.
    pub shared: bool,
    /// What comes out.
    pub out: &'a mut Arrivals,
}

impl<const PRODUCT: bool> Job for SampleQuad<'_, PRODUCT> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { block, samplers, quad, radiance, two_sided, dimension, members, shared, out } = self;
        let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
        samplers.pairs(dimension, &mut x, &mut y);
        let sides = [two_sided, shared];
        sample_quad::<PRODUCT>([&x, &y], block, quad, radiance, sides, 1.0 / members, out);
    }
}

/// References of its own: of those in a struct the compiler does not know that they are of different things, and makes no
/// vectors.
#[inline(always)]
fn sample_quad<const PRODUCT: bool>(
    [x, y]: [&Row; 2],
    block: &Block,
    quad: &Quad,
    radiance: &[Vec3; 4],
    [two_sided, shared]: [bool; 2],
    part: f32,
    out: &mut Arrivals,
) {
    let sharing = f32::from(u8::from(shared));
    for i in 0..LANES {
        let (point, normal) = (block.position.get(i), block.normal.get(i));
        let random = Vec2::new(x[i], y[i]);
        let place =
            if PRODUCT { quad.brightness(point, normal).sample(random) } else { Place::evenly(random) };
        let on_light = quad.at(&place);
        let d = on_light - point;
        let distance2 = d.length_squared();
        let height = (point - quad.corner).dot(quad.normal);
        let facing = if height > 0.0 { quad.normal } else { -quad.normal };
        let slope = normal.dot(d);
        let lit = (height > 0.0) | (two_sided & (height < 0.0));
        let lit = lit & (slope > 0.0) & (block.geometric_normal.get(i).dot(d) > 0.0) & (place.density > 0.0);
        let height = height.abs();
        let irradiance = (slope / distance2) * (height / distance2) * (quad.area / place.density) * part;
        // The power heuristic: density of the bounce over that of all samples of this light.
        let ratio = irradiance * (1.0 / PI) * sharing;
        let weight = irradiance * (1.0 / PI) / (1.0 + ratio * ratio);
        let left = radiance[0] + (radiance[2] - radiance[0]) * place.b;
        let right = radiance[1] + (radiance[3] - radiance[1]) * place.b;
        let brought = block.throughput.get(i) * (left + (right - left) * place.a) * weight;
        let brought = if lit { brought } else { Vec3::ZERO };
        let (certain, before) = (out.certain[i], out.contribution.get(i));
        out.contribution.set(i, if certain { before } else { brought });
        out.target.set(i, offset(on_light, error_of(on_light), facing));
        out.near[i] = quad.is_near(point) & !certain;
    }
}

/// All that a parallelogram light of one radiance brings to those points that are `certain` to have nothing in its way.
/// Those for which it is too small, or partly below the horizon, are certain no more.
pub struct IntegrateQuad<'a> {
    /// The points.
    pub block: &'a Block,
    /// The light.
    pub quad: &'a Quad,
    /// Its radiance.
    pub radiance: Vec3,
    /// Whether it emits to both sides.
    pub two_sided: bool,
    /// What comes out.
    pub out: &'a mut Arrivals,
}

impl Job for IntegrateQuad<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { block, quad, radiance, two_sided, out } = self;
        integrate_quad(block, quad, radiance, two_sided, out);
    }
}

/// See [`sample_quad`] for why.
#[inline(always)]
fn integrate_quad(block: &Block, quad: &Quad, radiance: Vec3, two_sided: bool, out: &mut Arrivals) {
    for i in 0..LANES {
        let (point, normal) = (block.position.get(i), block.normal.get(i));
        let above = quad.is_above(point, normal) & quad.is_above(point, block.geometric_normal.get(i));
        let irradiance = quad.irradiance(point, normal);
        let irradiance = if two_sided { irradiance.abs() } else { irradiance };
        let irradiance = if irradiance > 0.0 { irradiance } else { 0.0 };
        let brought = block.throughput.get(i) * radiance * (irradiance * (1.0 / PI));
        out.contribution.set(i, brought);
        out.certain[i] &= above & quad.is_large(point);
    }
}

/// A cosine-distributed direction from each point.
pub struct Depart<'a> {
    /// The points.
    pub block: &'a Block,
    /// Random numbers.
    pub samplers: &'a SamplerRow<LANES>,
    /// Which pair of random numbers.
    pub dimension: u32,
    /// What comes out.
    pub out: &'a mut Departures,
}

impl Job for Depart<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { block, samplers, dimension, out } = self;
        let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
        samplers.pairs(dimension, &mut x, &mut y);
        for i in 0..LANES {
            let normal = block.normal.get(i);
            let local = cosine_hemisphere(Vec2::new(x[i], y[i]));
            let (tangent, bitangent) = normal.any_orthonormal_pair();
            let sum = tangent * local.x + bitangent * local.y + normal * local.z;
            let direction = sum * (1.0 / sum.length());
            let cosine = normal.dot(direction);
            let above = (cosine > 0.0) & (block.geometric_normal.get(i).dot(direction) > 0.0);
            out.direction.set(i, direction);
            out.pdf[i] = if above { cosine * (1.0 / PI) } else { 0.0 };
        }
    }
}
