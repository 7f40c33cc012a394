//! How light travels: functions over flat arrays. No entities, no files, no clock.
//!
//! [`pass::trace_pass`] takes the tiles of the [`Film`] one by one; [`integrator`] follows all rays of
//! a tile together, wave by wave, through [`TraceScene`].

pub mod allot;
mod arrive;
pub mod block;
pub mod blocker;
pub mod bsdf;
pub mod camera;
mod connect;
pub mod convergence;
mod diffuse;
pub mod emitter;
pub mod explain;
pub mod features;
pub mod film;
pub mod first;
pub mod guess;
pub mod integrator;
pub mod light;
pub mod light_sampling;
pub mod light_tree;
pub mod lights;
pub mod mesh_light;
pub mod noise;
pub mod pass;
mod path;
pub mod place;
pub mod quad;
mod quad_arrivals;
mod reuse;
pub mod sampler;
pub mod scene;
pub mod settings;
pub mod shape_light;
mod sightlines;
mod single;
pub mod sky;
pub mod spherical;
pub mod surface;
pub mod texture;
pub mod visible;
pub mod warp;

pub use camera::Viewpoint;
pub use features::FeatureCounts;
pub use film::Film;
pub use light_sampling::LightSampling;
pub use lights::Lights;
pub use pass::{RayCounts, hurry, trace_adaptive, trace_half, trace_pass};
pub use scene::{Coverage, Geometry, Surfaces, TraceScene};
pub use settings::{Integrator, RenderSettings, Sampling};
