//! The error of a moving picture with old samples kept and without, at equal *time*: `cargo bench --bench kept`.
//!
//! Small steps forward and to the side after a rest of 32 samples; what keeping takes is given to the picture
//! without for more samples.

#[path = "../tests/kept/flight.rs"]
mod flight;

use flight::{HEAD, flights, fly, row};
use glam::UVec2;
use penumbra::preview::Preview;

fn main() {
    println!("{HEAD}");
    for (scene, integrator, _) in flights() {
        let flight = fly(&scene, integrator, UVec2::new(960, 540), Preview::default, |took| took);
        println!("{}", row(&scene, integrator, &flight));
    }
}
