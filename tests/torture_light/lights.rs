//! Renderers with a mistake in them, measured as ours is.

use crate::{finds, trial};
use glam::DVec3;
use penumbra::torture::light::lamps::{
    balls, cut_by_the_horizon, edge_on, far, huge, inside_a_ball, lines, quads, touching_the_floor, triangles,
};
use penumbra::torture::light::meter::{Ask, Meter, Plan, Reading, judge, measure, ours};
use penumbra::torture::light::oracle;
use penumbra::torture::light::pictures::fireflies;
use penumbra::torture::light::remedies::{
    choice, densities, either_side_of_a_switch, solid_angles, unlike_lights,
};
use penumbra::torture::light::rooms::{awkward_places, in_a_shining_cube, judge_form_factor, squares};
use penumbra::torture::light::shadows::{penumbra, shadows_of_a_line};
use penumbra::torture::light::spot::{Expected, Spot, Thing};
use penumbra::torture::oracle::Rng;
use penumbra::torture::{Check, Place};

fn judged(spots: &[Spot], meter: &Meter) -> Vec<Check> {
    let plan = Plan { places: &[Place::ORIGIN], ..Plan::of("X") };
    measure(&trial(), plan, spots, meter)
}

fn right(ask: &Ask) -> Reading {
    ours(ask, &|| true)
}

/// Ours, with every pixel changed.
fn but(ask: &Ask, change: impl Fn(usize, f64) -> f64) -> Reading {
    let mut reading = right(ask);
    reading.pixels.iter_mut().enumerate().for_each(|(i, pixel)| *pixel = change(i, *pixel));
    reading
}

/// A renderer of its own: points of a parallelogram, evenly by area, and what each brings.
fn by_area([corner, u, v]: [DVec3; 3], ask: &Ask, brought: impl Fn(f64, f64, f64) -> f64) -> Reading {
    let mut rng = Rng(u64::from(ask.seed) + 1);
    let (normal, side) = (ask.spot.normal, u.cross(v));
    let mut pixel = || {
        let mut sum = 0.0;
        for _ in 0..ask.samples {
            let d = corner + u * f64::from(rng.unit()) + v * f64::from(rng.unit()) - ask.spot.point;
            let there = d.normalize();
            let [here, there] = [normal.dot(there).max(0.0), side.dot(there).abs()];
            sum += brought(here, there, d.length_squared());
        }
        sum / f64::from(ask.samples)
    };
    let pixels: Vec<f64> = (0..256).map(|_| pixel()).collect();
    Reading { pixels, samples: 256 * u64::from(ask.samples), dropped: 0, shadow_rays: 1 }
}

const OVERHEAD: [DVec3; 3] = [DVec3::new(-0.5, -0.5, 1.0), DVec3::X, DVec3::Y];

/// What the judge compares with, beside figures that were computed by somebody else: by another program, which checked
/// them by quadrature; Nori's are those of its tests, of albedo ½.
#[test]
fn what_is_expected_is_what_the_tables_say() {
    let exact = |spot: &Spot| match &spot.expected {
        Expected::Value { exact, .. } => exact(spot.point),
        Expected::Dark => 0.0,
        _ => f64::NAN,
    };
    let nori = [0.0898392585, 0.0229200404, 0.0534195402, 0.0205313915, 0.2617398589];
    let nori = nori.map(|radiance| radiance * std::f64::consts::PI / 0.5);
    let near = [0.350188287714, 1.39322515884, 1.55294332112, 1.57061778698, 1.5707945414];
    let aside = [0.141919368835, 0.00341118100727, 3.41158273419e-5, 3.41158277437e-7, 0.0];
    let far_away = [0.00996678290640, 9.99999666667e-7, 9.99999996667e-9, 1e-12];
    let half = |x: f64| penumbra(1.0, 101).into_iter().find(|spot| (spot.point.x - x).abs() < 1e-9);
    let grey = [(-0.1, 0.0119913038438), (-0.05, 0.0212512329562), (0.0, 0.0306128805571)];
    let grey = [grey, [(0.05, 0.0399561702211), (0.1, 0.0491610740043), (-0.2, 0.0)]].concat();
    let (there, shown): (Vec<f64>, Vec<f64>) = grey.into_iter().unzip();
    let shadow: Vec<Spot> = there.into_iter().map(|x| half(x).unwrap()).collect();
    for (name, spots, figures) in [
        ("L1", quads(), &[0.752274688454, 0.054022002505][..]),
        ("L2", triangles(), &[[0.302299894039].as_slice(), &nori].concat()),
        ("L3", cut_by_the_horizon()[..1].to_vec(), &[0.0875102647738]),
        ("L4", touching_the_floor(), &near),
        ("L5", edge_on(), &aside),
        ("L6", far(), &far_away),
        ("L7", huge(), &[std::f64::consts::PI]),
        ("L11", shadow, &shown),
    ] {
        assert_eq!(spots.len(), figures.len(), "{name}");
        for (spot, figure) in spots.iter().zip(figures) {
            // Nori's corners are single precision; all others have ten digits or more.
            let digits = if spot.name == "Nori's" { 1e-7 } else { 1e-10 };
            let off = (exact(spot) - figure).abs();
            assert!(off <= digits * figure, "{name}, {}: {} {figure}", spot.name, exact(spot));
        }
    }
}

#[test]
fn another_renderer_passes_too() {
    let mut spots = quads();
    spots.truncate(1);
    spots[0].computed = false;
    let checks = judged(&spots, &|ask| by_area(OVERHEAD, ask, |here, there, d2| here * there / d2));
    assert!(checks.iter().all(Check::holds), "{checks:#?}");
}

#[test]
fn half_a_percent_more_light_is_found() {
    let checks = judged(&quads(), &|ask| but(ask, |_, pixel| pixel * 1.005));
    finds("standard errors off", &checks);
    finds("computed", &checks);
    // Computed light is known to far more digits.
    finds("computed", &judged(&quads(), &|ask| but(ask, |_, pixel| pixel * 1.000_05)));
}

/// Half a percent more than is right, light where it is dark, other light where it should be the same, no number where
/// any would do: no spot of any list is so wide that it lets that pass.
#[test]
fn every_spot_has_a_limit() {
    let lists = [
        [quads(), triangles(), cut_by_the_horizon(), touching_the_floor(), edge_on(), far()].concat(),
        [huge(), balls(), inside_a_ball(), lines(), fireflies(), unlike_lights()].concat(),
        [penumbra(1.0, 11), penumbra(1e-3, 11), shadows_of_a_line()].concat(),
        [in_a_shining_cube(), awkward_places(), either_side_of_a_switch()].concat(),
    ];
    let off = |ask: &Ask| {
        let exact = |exact: f64| if exact == 0.0 { 1e-9 } else { exact * 1.005 };
        let pixel = match &ask.spot.expected {
            Expected::Value { exact: of, .. } => exact(of(ask.spot.point)),
            Expected::Dark => 1e-30,
            Expected::Same(_) => 0.0,
            Expected::Finite => f64::NAN,
        };
        let noise = |i: i32| 1.0 + 1e-6 * f64::from(i % 3 - 1);
        let pixels = (0..256).map(|i| pixel * noise(i)).collect();
        Reading { pixels, samples: 256, dropped: 0, shadow_rays: u64::from(!ask.computed) }
    };
    let mut deaf = Vec::new();
    let spots = lists.concat();
    for (spot, place) in spots.iter().flat_map(|spot| Place::ALL.map(|place| (spot, place))) {
        for computed in [false, true].into_iter().take(1 + usize::from(spot.computed)) {
            let ask = Ask { place, computed, ..Ask::new(spot, 1, 0) };
            let same = match &spot.expected {
                Expected::Same(other) => Some(off(&Ask { spot: other, ..ask })),
                _ => None,
            };
            let checks = judge(&spot.name, &ask, &off(&ask), same.as_ref());
            if checks.iter().all(Check::holds) {
                deaf.push(format!("{}, {}", spot.name, place.name()));
            }
        }
    }
    println!("{} of {} do not notice: {deaf:#?}", deaf.len(), 5 * spots.len());
    assert!(deaf.is_empty());
}

#[test]
fn a_density_one_percent_wrong_is_found() {
    let checks = judged(&quads(), &|ask| but(ask, |_, pixel| pixel / 1.01));
    finds("standard errors off", &checks);
    let checks = densities(&trial(), &|_| 1.01);
    finds("integral", &checks);
    finds("of its ray", &checks);
    finds("χ²", &densities(&trial(), &|wi| if wi.x < 0.3 { 0.97 } else { 1.03 }));
}

#[test]
fn a_lost_cosine_is_found() {
    let mut spots = quads();
    spots.truncate(1);
    let checks = judged(&spots, &|ask| by_area(OVERHEAD, ask, |_, there, d2| there / d2));
    finds("standard errors off", &checks);
    let checks = judged(&spots, &|ask| by_area(OVERHEAD, ask, |here, _, d2| here / d2));
    finds("standard errors off", &checks);
}

#[test]
fn a_horizon_that_cuts_nothing_is_found() {
    let corner = DVec3::new(2.0, -1.0, -1.0);
    let (u, v) = (DVec3::Y * 2.0, DVec3::Z * 2.0);
    let corners = [corner, corner + u, corner + u + v, corner + v];
    let unclipped = oracle::unclipped_polygon(&corners, DVec3::ZERO, DVec3::Z);
    let mut spots = cut_by_the_horizon();
    spots.truncate(1);
    finds("computed", &judged(&spots, &|ask| but(ask, |_, _| unclipped)));
}

#[test]
fn light_sampled_by_area_where_it_is_near_is_found() {
    let spots = &touching_the_floor()[3..4];
    let light = [DVec3::new(0.0, -1.0, 0.0), DVec3::Y * 2.0, DVec3::Z];
    let checks = judged(spots, &|ask| {
        let few = Ask { samples: ask.samples.min(1024), ..*ask };
        by_area(light, &few, |here, there, d2| here * there / d2)
    });
    finds("standard errors, relative", &checks);
}

#[test]
fn computed_light_that_was_sampled_is_found() {
    let checks =
        judged(&quads(), &|ask| right(&Ask { computed: false, samples: ask.samples.max(64), ..*ask }));
    finds("rays spent", &checks);
}

#[test]
fn clamped_samples_are_found() {
    // The disk's, by area: one sample in some hundred brings more than 32.
    let spots = &fireflies()[1..2];
    let clamped = |most: f64| {
        move |ask: &Ask| {
            let mut rng = Rng(u64::from(ask.seed) + 1);
            let mut pixel = || {
                let mut sum = 0.0;
                for _ in 0..ask.samples {
                    let r2 = f64::from(rng.unit()) + 0.05 * 0.05;
                    sum += (std::f64::consts::PI * (0.05 / r2).powi(2)).min(most);
                }
                sum / f64::from(ask.samples)
            };
            let pixels: Vec<f64> = (0..256).map(|_| pixel()).collect();
            Reading { pixels, samples: 256 * u64::from(ask.samples), dropped: 0, shadow_rays: 1 }
        }
    };
    finds("standard errors off", &judged(spots, &clamped(100.0)));
    let off = judged(spots, &clamped(f64::INFINITY));
    let off: Vec<_> = off.into_iter().filter(|check| check.what.contains("errors off")).collect();
    assert!(off.iter().all(Check::holds), "{off:#?}");
}

#[test]
fn one_pixel_in_the_umbra_is_found() {
    // Where part of the light is seen is another test's.
    let mut spots = penumbra(1.0, 9);
    spots.retain(|spot| !matches!(spot.expected, Expected::Value { .. }));
    let leak = |ask: &Ask| {
        let dark = matches!(ask.spot.expected, Expected::Dark);
        but(ask, |i, pixel| if dark && i == 77 { 1e-30 } else { pixel })
    };
    finds("exactly dark", &judged(&spots, &leak));
    let minus = |ask: &Ask| but(ask, |_, pixel| if pixel == 0.0 { -0.0 } else { pixel });
    finds("exactly dark", &judged(&spots, &minus));
    // And one bit where all of the light should be seen.
    let bit = |ask: &Ask| {
        let same = matches!(ask.spot.expected, Expected::Same(_));
        but(ask, |i, pixel| if same && i == 3 { pixel.next_up() } else { pixel })
    };
    finds("exactly the same", &judged(&spots, &bit));
}

/// The opaque half-plane is moved: an edge of shadow goes over a hundredth of the light.
#[test]
fn an_edge_a_little_off_is_found() {
    let checks = judged(&penumbra(1.0, 9), &|ask| {
        let mut spot = ask.spot.clone();
        for thing in &mut spot.things {
            if let Thing::Mesh(mesh, ..) = thing {
                mesh.positions.iter_mut().for_each(|p| p.x -= 0.003);
            }
        }
        right(&Ask { spot: &spot, ..*ask })
    });
    finds("computed", &checks);
    finds("standard errors off", &checks);
}

#[test]
fn what_is_no_number_is_found() {
    let odd = |bad: f64| move |ask: &Ask| but(ask, |i, pixel| if i == 9 { bad } else { pixel });
    let mut odd_places = awkward_places();
    odd_places.retain(|spot| matches!(spot.expected, Expected::Finite));
    odd_places.truncate(2);
    let mut spots = quads();
    spots.truncate(1);
    for bad in [f64::NAN, f64::INFINITY, -1e-9] {
        finds("finite", &judged(&odd_places, &odd(bad)));
    }
    finds("computed", &judged(&spots, &odd(f64::NAN)));
    let sampled: Vec<Spot> = spots.iter().map(|spot| Spot { computed: false, ..spot.clone() }).collect();
    let few = |ask: &Ask| odd(f64::NAN)(&Ask { samples: ask.samples.min(64), ..*ask });
    finds("standard errors off", &judged(&sampled, &few));
    let dropped = |ask: &Ask| Reading { dropped: 1, ..right(ask) };
    finds("no number", &judged(&spots, &dropped));
}

#[test]
fn a_form_factor_half_a_percent_off_is_found() {
    let (_, _, exact) = squares()[0];
    let mut rng = Rng(4);
    let factors = |by: f64, rng: &mut Rng| -> Vec<f64> {
        (0..16).map(|_| exact * by * (1.0 + 1e-3 * (f64::from(rng.unit()) - 0.5))).collect()
    };
    let fair = judge_form_factor("fair", 1, &factors(1.0, &mut rng), exact);
    assert!(fair.iter().all(Check::holds), "{fair:#?}");
    finds("standard errors off", &judge_form_factor("off", 1, &factors(1.005, &mut rng), exact));
    let noisy: Vec<f64> = (0..16).map(|i| exact * (1.0 + 0.05 * f64::from(i % 3 - 1))).collect();
    finds("4.5 standard errors", &judge_form_factor("noisy", 1, &noisy, exact));
}

#[test]
fn choice_by_power_alone_is_found() {
    // Power 1e8 and 1; what is near and faint brings as much.
    let by_power = choice("by power", &[1.0 - 1e-8, 1e-8], &[1.0, 1.0]);
    assert!(!by_power.holds(), "{by_power:?}");
    assert!(choice("half by power", &[0.75, 0.25], &[1.0, 1.0]).holds());
}

#[test]
fn a_solid_angle_by_arc_cosines_is_found() {
    // The excess of the angles over half a turn: nothing is left of it far away, even in double precision.
    let by_excess = |corners: [DVec3; 3]| {
        let [a, b, c] = corners.map(DVec3::normalize);
        let angle = |a: DVec3, b: DVec3, c: DVec3| {
            let (n, m) = (a.cross(b).normalize(), a.cross(c).normalize());
            n.dot(m).clamp(-1.0, 1.0).acos()
        };
        angle(a, b, c) + angle(b, c, a) + angle(c, a, b) - std::f64::consts::PI
    };
    assert!(!solid_angles(1000, 1, by_excess).holds());
}
