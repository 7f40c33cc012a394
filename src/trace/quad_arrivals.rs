//! What parallelogram lights bring to the points of a block.

use super::block::{Arrivals, Block, IntegrateQuad, LANES, SampleQuad};
use super::connect::power_heuristic;
use super::quad::Quad;
use super::sampler::SamplerRow;
use super::shape_light::{Shape, ShapeLight};
use super::sightlines::Sightlines;
use super::visible::{HIDDEN, Reach, irradiance};
use super::{Integrator, TraceScene, spherical};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// All that a parallelogram light brings where it is known what is in the way; elsewhere `out` is not certain. How many are
/// not.
pub(super) fn compute_quad(
    scene: &TraceScene,
    block: &Block,
    sightlines: &Sightlines,
    shape: &ShapeLight,
    light: u32,
    out: &mut Arrivals,
) -> usize {
    let Shape::Parallelogram(quad) = &shape.shape else { return 0 };
    let isa = scene.geometry.tlas.isa();
    let mut missing = block.count;
    out.certain = [false; LANES];
    if shape.radiance.iter().all(|r| *r == shape.radiance[0]) {
        let radiance = shape.radiance[0];
        let which = in_the_way(scene, block, sightlines, quad, light);
        for (certain, which) in out.certain.iter_mut().zip(&which[..block.count]) {
            *certain = *which == Some(0);
        }
        if out.certain[..block.count].contains(&true) {
            isa.run(IntegrateQuad { block, quad, radiance, two_sided: shape.two_sided, out });
        }
        for i in 0..block.count {
            if !out.certain[i]
                && let Some(which) = which[i]
                && (scene.settings.cuts || which == 0)
                && let Some(irradiance) = seen_past(block, i, shape, quad, sightlines, light, which)
            {
                out.contribution.set(i, block.throughput.get(i) * radiance * (irradiance / PI));
                out.certain[i] = true;
            }
            missing -= usize::from(out.certain[i]);
        }
    }
    missing
}

/// A sample of a parallelogram light, one of `members`, for each point for which `out` is not certain.
pub(super) fn sample_quad(
    scene: &TraceScene,
    block: &Block,
    samplers: &SamplerRow<LANES>,
    shape: &ShapeLight,
    [dimension, members]: [u32; 2],
    out: &mut Arrivals,
) {
    let Shape::Parallelogram(quad) = &shape.shape else { return };
    let (radiance, two_sided) = (&shape.radiance, shape.two_sided);
    let shared = scene.settings.integrator == Integrator::Path;
    let (isa, members) = (scene.geometry.tlas.isa(), members as f32);
    if shape.sampling.product {
        isa.run(SampleQuad::<true> {
            block,
            samplers,
            quad,
            radiance,
            two_sided,
            dimension,
            members,
            shared,
            out: &mut *out,
        });
    } else {
        isa.run(SampleQuad::<false> {
            block,
            samplers,
            quad,
            radiance,
            two_sided,
            dimension,
            members,
            shared,
            out: &mut *out,
        });
    }
    if !shape.sampling.solid_angle {
        return;
    }
    for i in 0..block.count {
        if out.near[i] {
            let random = samplers.get(i).pair(dimension);
            sample_near(block, i, shape, (random, members), shared, out);
        }
    }
}

/// A sample of a light that is near one point.
fn sample_near(
    block: &Block,
    i: usize,
    shape: &ShapeLight,
    (random, members): (Vec2, f32),
    shared: bool,
    out: &mut Arrivals,
) {
    out.contribution.set(i, Vec3::ZERO);
    let normal = block.normal.get(i);
    let Some(sample) = shape.sample(block.position.get(i), normal, random) else { return };
    let (Some(pdf), Some(target)) = (sample.pdf, sample.target) else { return };
    let pdf = pdf * members;
    let cosine = normal.dot(sample.wi);
    if cosine <= 0.0 || block.geometric_normal.get(i).dot(sample.wi) <= 0.0 {
        return;
    }
    let weight = if shared { power_heuristic(pdf, cosine / PI) } else { 1.0 };
    let brought = block.throughput.get(i) * sample.radiance * (cosine * weight / (PI * pdf));
    out.contribution.set(i, brought);
    out.target.set(i, target);
}

/// For each point of a block which of the known blockers may hide some of a light; `None` where they are not known.
fn in_the_way(
    scene: &TraceScene,
    block: &Block,
    sightlines: &Sightlines,
    quad: &Quad,
    light: u32,
) -> [Option<u32>; LANES] {
    let mut which = [None; LANES];
    let mut done = 0;
    // Neighbours are mostly on the same triangle.
    while let Some(first) = (done..block.count).find(|&i| block.known[i].is_some()) {
        let known = block.known[first];
        let own = |i: &usize| block.known[*i] == known;
        let end = first + (first..block.count).take_while(own).count();
        if let Some(blockers) = known.and_then(|known| sightlines.blockers(known, light)) {
            let mut out = [0; LANES];
            if !blockers.is_empty() {
                let lanes = first..end;
                scene.geometry.tlas.isa().run(Reach { block, lanes, quad, blockers, out: &mut out });
            }
            for (which, out) in which[first..end].iter_mut().zip(&out[first..end]) {
                *which = Some(*out);
            }
        }
        done = end;
    }
    which
}

/// Irradiance at a point of a block from a light of radiance 1 past those of its blockers, if it can be told.
fn seen_past(
    block: &Block,
    i: usize,
    shape: &ShapeLight,
    quad: &Quad,
    sightlines: &Sightlines,
    light: u32,
    which: u32,
) -> Option<f32> {
    let point = block.position.get(i);
    let height = (point - quad.corner).dot(quad.normal);
    if which == HIDDEN || height == 0.0 || !shape.two_sided && height < 0.0 {
        return Some(0.0);
    }
    let normals = [block.normal.get(i), block.geometric_normal.get(i)];
    if !quad.is_large(point) {
        return (which == 0).then(|| spherical::irradiance(quad, point, normals) as f32);
    }
    let blockers = sightlines.blockers(block.known[i]?, light)?;
    irradiance(quad, point, normals, blockers, which)
}
