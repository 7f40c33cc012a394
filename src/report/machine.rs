//! What the figures were measured on.

use crate::bvh::Isa;
use serde::Serialize;

/// The machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// Name of the processor, as the system tells it.
    pub processor: String,
    /// Threads that traced.
    pub threads: usize,
    /// Instruction set of the traversal.
    pub isa: &'static str,
    /// Operating system and architecture.
    pub system: String,
}

impl Machine {
    /// This one.
    #[must_use]
    pub fn here() -> Self {
        let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let name = cpuinfo
            .lines()
            .find(|line| line.starts_with("model name"))
            .and_then(|line| line.split_once(':'))
            .map(|(_, name)| name.trim().to_owned());
        Self {
            processor: name.unwrap_or_else(|| "unknown processor".to_owned()),
            threads: rayon::current_num_threads(),
            isa: Isa::detect().name(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        }
    }
}
