//! Which instructions to use, decided once.

use super::portable::{Narrow, Plain};
#[cfg(target_arch = "x86_64")]
use super::x86::{Avx2, Avx512};
use super::{Part, Simd};
use std::sync::LazyLock;

/// A set of instructions that this machine is known to have.
#[derive(Clone, Copy, Debug)]
pub struct Isa(Kind);

#[derive(Clone, Copy, Debug)]
enum Kind {
    Plain,
    Narrow,
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
}

/// Something to do with any instruction set.
///
/// `run` and all it calls in its hot part must be `#[inline(always)]`, or they are compiled for the
/// oldest machine.
pub trait Job {
    /// What comes out.
    type Output;
    /// Does it.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

impl<S: Simd, J: Job> Part<S> for J {
    type Output = J::Output;

    #[inline(always)]
    fn run(self, simd: S) -> J::Output {
        Job::run(self, simd)
    }
}

impl Default for Isa {
    fn default() -> Self {
        Self::detect()
    }
}

impl PartialEq for Isa {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Isa {
    /// One float at a time; every machine has it.
    pub const SCALAR: Self = Self(Kind::Plain);

    /// The widest that this machine has, found out once.
    #[must_use]
    pub fn detect() -> Self {
        static WIDEST: LazyLock<Isa> = LazyLock::new(|| Isa::available().pop().unwrap_or(Isa::SCALAR));
        *WIDEST
    }

    /// All that this machine has, narrowest first.
    #[must_use]
    pub fn available() -> Vec<Self> {
        #[cfg_attr(not(target_arch = "x86_64"), expect(unused_mut, reason = "nothing to add elsewhere"))]
        let mut all = vec![Self(Kind::Plain), Self(Kind::Narrow)];
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(Avx2::detect().map(|proof| Self(Kind::Avx2(proof))));
            all.extend(Avx512::detect().map(|proof| Self(Kind::Avx512(proof))));
        }
        all
    }

    /// The one called `name`, if there is such a one and this machine has it.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::available().into_iter().find(|isa| isa.name() == name)
    }

    /// What the command line calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self.0 {
            Kind::Plain => "scalar",
            Kind::Narrow if cfg!(target_arch = "x86_64") => "sse2",
            Kind::Narrow if cfg!(target_arch = "aarch64") => "neon",
            Kind::Narrow => "simd128",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(_) => "avx512",
        }
    }

    /// Runs `job`, compiled for these instructions.
    #[inline]
    pub fn run<J: Job>(self, job: J) -> J::Output {
        match self.0 {
            Kind::Plain => Plain.call(job),
            Kind::Narrow => Narrow.call(job),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(proof) => proof.call(job),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(proof) => proof.call(job),
        }
    }
}
