//! Threads and Ctrl-C.

use crate::exit;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Threads to trace with; 0: all.
pub fn set_threads(threads: usize) {
    // Fails only if the pool is already there, which is no harm.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
}

/// The first signal asks for an end with a picture, the second ends at once.
pub fn stop_on_signals(interrupt: &Arc<AtomicBool>) {
    let interrupt = Arc::clone(interrupt);
    let set = ctrlc::set_handler(move || {
        if interrupt.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(exit::INTERRUPTED));
        }
    });
    if let Err(error) = set {
        eprintln!("warning: Ctrl-C will not save the picture: {error}");
    }
}
