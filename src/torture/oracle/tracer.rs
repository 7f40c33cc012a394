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

/// Asks all four questions.
#[must_use]
pub fn ask(tracer: &dyn Tracer, rays: &[Ray]) -> Answers {
    let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    tracer.closest_hits(rays, &mut hits);
    tracer.any_hits(rays, &mut blocked);
    let hits_alone = rays.iter().map(|ray| tracer.closest_hit(ray)).collect();
    let blocked_alone = rays.iter().map(|ray| tracer.any_hit(ray)).collect();
    Answers { hits, blocked, hits_alone, blocked_alone }
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
