//! How much memory loading may take, so that a hostile or huge file is an error and not a dead machine.

use super::error::LoadError;
use std::fs;
use std::sync::atomic::{AtomicU64, Ordering};

/// Where nobody can tell how much there is.
const UNKNOWN: u64 = 8 << 30;

/// A limit and what has been promised of it.
#[derive(Debug)]
pub(super) struct Budget {
    limit: u64,
    taken: AtomicU64,
}

impl Budget {
    /// `limit` bytes, else three quarters of what this machine has left.
    pub(super) fn new(limit: Option<u64>) -> Self {
        Self { limit: limit.unwrap_or_else(|| machine_has() / 4 * 3), taken: AtomicU64::new(0) }
    }

    /// Asks for `bytes` before they are allocated; they are never given back.
    ///
    /// # Errors
    /// If that is more than is left.
    pub(super) fn take(&self, bytes: u64, file: &str, place: &str) -> Result<(), LoadError> {
        let more = |taken: u64| Some(taken.saturating_add(bytes)).filter(|&sum| sum <= self.limit);
        match self.taken.fetch_update(Ordering::Relaxed, Ordering::Relaxed, more) {
            Ok(_) => Ok(()),
            Err(taken) => Err(LoadError::Memory {
                file: file.to_owned(),
                place: place.to_owned(),
                needed: megabytes(taken.saturating_add(bytes)),
                limit: megabytes(self.limit),
            }),
        }
    }

    /// What is left.
    pub(super) fn left(&self) -> u64 {
        self.limit.saturating_sub(self.taken.load(Ordering::Relaxed))
    }
}

fn megabytes(bytes: u64) -> u64 {
    bytes.div_ceil(1 << 20)
}

/// Memory that is free: of the machine, of the group of processes, and of this process's own limit (`ulimit -v`).
fn machine_has() -> u64 {
    let machine = read("/proc/meminfo").and_then(|text| Some(1024 * after(&text, "MemAvailable:")?));
    let group = |name: &str| read(&format!("/sys/fs/cgroup/{name}"))?.trim().parse::<u64>().ok();
    let group = group("memory.max").map(|most| most.saturating_sub(group("memory.current").unwrap_or(0)));
    let process = read("/proc/self/limits").and_then(|text| {
        let most = after(&text, "Max address space")?;
        let used = read("/proc/self/status").and_then(|text| after(&text, "VmSize:")).unwrap_or(0);
        Some(most.saturating_sub(1024 * used))
    });
    [machine, group, process].into_iter().flatten().min().unwrap_or(UNKNOWN)
}

fn read(path: &str) -> Option<String> {
    fs::read_to_string(path).ok()
}

/// The number after a key; `None` also for `unlimited`.
fn after(text: &str, key: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix(key))?;
    rest.split_ascii_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_is_gone() {
        let budget = Budget::new(Some(10 << 20));
        assert!(budget.take(6 << 20, "a.glb", "mesh 0").is_ok());
        assert_eq!(budget.left(), 4 << 20);
        let refused = budget.take(5 << 20, "a.glb", "mesh 1").unwrap_err().to_string();
        assert_eq!(
            refused,
            "a.glb: mesh 1: takes loading to 11 MiB of memory, more than the 10 MiB allowed; allow more with --max-memory"
        );
        assert!(Budget::new(Some(u64::MAX)).take(u64::MAX, "", "").is_ok());
    }

    #[test]
    fn this_machine_has_some_memory() {
        assert!((1 << 24..1 << 50).contains(&machine_has()));
        assert_eq!(after("Max address space   1000  unlimited bytes", "Max address space"), Some(1000));
        assert_eq!(after("Max address space   unlimited", "Max address space"), None);
    }
}
