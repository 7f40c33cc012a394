//! Something that answers rays.

use crate::bvh::{Blas, Hit, Isa, Ray, Tlas};
use glam::Vec3;

/// Something that answers rays: this program's hierarchies, another engine, or a saboteur.
pub trait Tracer: Send + Sync {
    /// The nearest hit; of equally near ones that of the lowest triangle index.
    fn closest_hit(&self, ray: &Ray) -> Option<Hit>;

    /// Whether there is any hit.
    fn any_hit(&self, ray: &Ray) -> bool;

    /// [`Tracer::closest_hit`] for each ray.
    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.closest_hit(ray);
        }
    }

    /// [`Tracer::any_hit`] for each ray.
    fn any_hits(&self, rays: &[Ray], blocked: &mut [bool]) {
        for (ray, blocked) in rays.iter().zip(blocked) {
            *blocked = self.any_hit(ray);
        }
    }
}

impl Tracer for Blas {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        Self::closest_hit(self, ray)
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        Self::any_hit(self, ray)
    }

    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        Self::closest_hits(self, rays, hits);
    }

    fn any_hits(&self, rays: &[Ray], blocked: &mut [bool]) {
        Self::any_hits(self, rays, blocked);
    }
}

impl Tracer for Tlas {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        Self::closest_hit(self, ray)
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        Self::any_hit(self, ray)
    }

    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        Self::closest_hits(self, rays, hits, None);
    }

    fn any_hits(&self, rays: &[Ray], blocked: &mut [bool]) {
        Self::any_hits(self, rays, blocked, None);
    }
}

impl<T: Tracer + ?Sized> Tracer for Box<T> {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        (**self).closest_hit(ray)
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        (**self).any_hit(ray)
    }

    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        (**self).closest_hits(rays, hits);
    }

    fn any_hits(&self, rays: &[Ray], blocked: &mut [bool]) {
        (**self).any_hits(rays, blocked);
    }
}

/// A way to make a [`Tracer`] of triangles.
pub struct Maker<'a> {
    /// What a table calls it.
    pub name: String,
    /// Makes one.
    pub make: Box<dyn Fn(&[[Vec3; 3]]) -> Box<dyn Tracer> + Sync + 'a>,
}

impl<'a> Maker<'a> {
    /// Of a function.
    #[must_use]
    pub fn new<T: Tracer + 'static>(
        name: impl Into<String>,
        make: impl Fn(&[[Vec3; 3]]) -> T + Sync + 'a,
    ) -> Self {
        Self { name: name.into(), make: Box::new(move |triangles| Box::new(make(triangles))) }
    }
}

/// Ours, with each set of instructions that this machine has.
#[must_use]
pub fn kernels() -> Vec<Maker<'static>> {
    let maker = |isa: Isa| Maker::new(isa.name(), move |triangles| Blas::build(triangles).with_isa(isa));
    Isa::available().into_iter().map(maker).collect()
}

/// What a [`Tracer`] says of rays: together and one by one, the nearest hit and any.
#[derive(Clone, Debug)]
pub struct Answers {
    /// Nearest hits, asked together.
    pub hits: Vec<Option<Hit>>,
    /// Any hits, asked together.
    pub blocked: Vec<bool>,
    /// Nearest hits, asked one by one.
    pub hits_alone: Vec<Option<Hit>>,
    /// Any hits, asked one by one.
    pub blocked_alone: Vec<bool>,
}

/// Asks all four questions; of batches of some hundred rays the first half in packets, all others mostly by twos.
#[must_use]
pub fn ask(tracer: &dyn Tracer, rays: &[Ray]) -> Answers {
    let order = half_alike(rays);
    let batch: Vec<Ray> = order.iter().map(|&i| rays[i]).collect();
    let (mut found, mut is_blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    tracer.closest_hits(&batch, &mut found);
    tracer.any_hits(&batch, &mut is_blocked);
    let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    for (&i, (hit, is_blocked)) in order.iter().zip(found.into_iter().zip(is_blocked)) {
        (hits[i], blocked[i]) = (hit, is_blocked);
    }
    let hits_alone = rays.iter().map(|ray| tracer.closest_hit(ray)).collect();
    let blocked_alone = rays.iter().map(|ray| tracer.any_hit(ray)).collect();
    Answers { hits, blocked, hits_alone, blocked_alone }
}

/// The numbers of the rays, the first half with such side by side as may share a packet: in one octant, and longest
/// along the same axis.
fn half_alike(rays: &[Ray]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..rays.len()).collect();
    order[..rays.len() / 2].sort_by_key(|&i| class(&rays[i]));
    order
}

fn class(ray: &Ray) -> (u32, usize) {
    (ray.direction.is_negative_bitmask(), ray.direction.abs().max_position())
}

impl Answers {
    /// How many rays got an answer that is not the `expected` one, bit for bit, to any of the questions.
    #[must_use]
    pub fn wrong(&self, expected: &[Option<Hit>]) -> u64 {
        self.wrong_by(|i, hit| hit == expected[i].as_ref(), |i| expected[i].is_some())
    }

    /// The same where whoever asks says which hit is right for ray `i`, and whether it is blocked.
    #[must_use]
    pub fn wrong_by(
        &self,
        right: impl Fn(usize, Option<&Hit>) -> bool,
        blocked: impl Fn(usize) -> bool,
    ) -> u64 {
        let wrong = |&i: &usize| {
            !right(i, self.hits[i].as_ref())
                || !right(i, self.hits_alone[i].as_ref())
                || self.blocked[i] != blocked(i)
                || self.blocked_alone[i] != blocked(i)
        };
        (0..self.hits.len()).filter(wrong).count() as u64
    }

    /// Rays of which any of the answers is that there is nothing.
    #[must_use]
    pub fn leaks(&self) -> u64 {
        self.wrong_by(|_, hit| hit.is_some(), |_| true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::torture::oracle::Rng;

    #[test]
    fn half_of_a_batch_goes_in_packets() {
        let mut rng = Rng(3);
        let rays: Vec<Ray> = (0..1024).map(|_| Ray::new(Vec3::ZERO, rng.direction())).collect();
        let order = half_alike(&rays);
        assert!(order[512..].iter().copied().eq(512..1024));
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..1024));
        // Batches are parted by 64 rays, and six alike make a packet.
        let in_packets = |part: &[usize]| {
            let chunks = part.chunks(64);
            let many = |chunk: &[usize], i: usize| {
                chunk.iter().filter(|&&j| class(&rays[j]) == class(&rays[i])).count() >= 6
            };
            chunks.map(|chunk| chunk.iter().filter(|&&i| many(chunk, i)).count()).sum::<usize>()
        };
        let (alike, mixed) = (in_packets(&order[..512]), in_packets(&order[512..]));
        assert!(alike > 450 && mixed < 100, "{alike} and {mixed} of 512");
    }
}
