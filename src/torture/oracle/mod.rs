//! What knows the answer: exact arithmetic, trying everything, going around; and the rays that are asked about.
//!
//! Checkers know nothing of this program: whatever answers rays is a [`Tracer`], so that other engines and
//! saboteurs can be put in our place.

mod balls;
mod brute;
mod closed;
mod containment;
mod exact;
mod rng;
mod textbook;
mod tracer;
mod truth;

pub use balls::Balls;
pub use brute::{Brute, brute_force, brute_force_in};
pub use closed::{inside, is_closed, winding_number};
pub use containment::{check, check_hierarchy};
pub use exact::Exact;
pub use rng::Rng;
pub use textbook::moller_trumbore;
pub use tracer::{Answers, Maker, Tracer, ask, kernels};
pub use truth::{Truth, truth};
