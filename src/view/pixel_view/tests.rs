//! What is shown in place of light, and when.

use super::super::instrument::Reference;
use super::*;

#[test]
fn the_key_goes_round_all_views_both_ways() {
    let mut view = PixelView::Beauty;
    let mut seen = Vec::new();
    for _ in ALL {
        view = view.stepped(1);
        assert!(!seen.contains(&view));
        seen.push(view);
    }
    assert_eq!(view, PixelView::Beauty);
    assert_eq!(view.stepped(-1), PixelView::NotFinite);
}

#[test]
fn a_pixel_whose_sample_was_dropped_is_red_and_no_other() {
    let mut film = Film::new(UVec2::new(20, 12), 0);
    for tile in film.tiles_mut() {
        let (width, origin) = (tile.size.x, tile.origin);
        for (i, pixel) in tile.pixels_mut().iter_mut().enumerate() {
            let place = origin + UVec2::new(i as u32 % width, i as u32 / width);
            let light = if place == UVec2::new(13, 9) { f32::NAN } else { 0.5 };
            pixel.add(0, Vec3::splat(light));
        }
        tile.next_sample = 1;
    }
    let colors = not_finite(&film);
    let red: Vec<usize> = (0..colors.len()).filter(|&i| colors[i][0] == 255).collect();
    assert_eq!(red, [9 * 20 + 13]);
}

#[test]
fn more_is_lighter_and_depth_is_darker() {
    let (colors, range) = linear(&[0.0, 10.0, 20.0]);
    let light = |c: &[u8; 3]| c.iter().map(|&c| u32::from(c)).sum::<u32>();
    assert!(light(&colors[0]) < light(&colors[1]) && light(&colors[1]) < light(&colors[2]));
    assert_eq!(range.unwrap(), ["0", "20"]);
    let (colors, _) = near_bright(&[1.0, 5.0, f32::INFINITY], 1.0);
    assert_eq!(colors, [[255; 3], [35; 3], [0; 3]]);
    let (_, range) = near_bright(&[800.006, 1359.2], 1.0);
    assert_eq!(range.unwrap(), ["800", "1359"], "from near to far");
    let (_, range) = near_bright(&[1000.1, 1000.9], 1.0);
    assert_eq!(range.unwrap(), ["1000.10", "1000.90"], "as many digits as tell them apart");
    near_bright(&[f32::INFINITY; 3], 1.0);
    assert_eq!(linear(&[]).0.len(), 0);
}
#[test]
fn where_there_is_no_reference_the_picture_is_shown_and_told() {
    let mut world = World::new();
    let size = UVec2::new(2, 1);
    let image = LinearImage { size, pixels: vec![Vec3::ONE; 2] };
    world.init_resource::<RenderSettings>();
    let reference = Reference::new(image, Viewpoint::default(), Seen::of(&world));
    world.insert_resource(Instrument::against(Some(reference)));
    world.insert_resource(PixelView::Error);
    world.insert_resource(Film::new(size, 0));
    world.init_resource::<Viewpoint>();
    world.init_resource::<FrameBudget>();
    world.init_resource::<Unknown>();
    world.init_resource::<Display>();
    world.init_resource::<FirstHits>();
    world.init_resource::<CurrentLegend>();
    world.init_resource::<Picture>();
    let mut schedule = Schedule::default();
    schedule.add_systems((choose_developed, develop_pixel_view).chain());
    let mut shown = |world: &mut World| {
        schedule.run(world);
        let legend = world.resource::<CurrentLegend>().0.clone().unwrap();
        (world.resource::<FrameBudget>().develop, legend.range.is_some(), legend.title)
    };
    assert_eq!(shown(&mut world), (false, true, PixelView::Error.title()));
    let moved = glam::DAffine3::from_translation(glam::DVec3::X);
    world.insert_resource(Viewpoint::new(&moved, crate::scene::Camera::default().projection));
    let (develops, has_scale, title) = shown(&mut world);
    assert!(develops && !has_scale && title.contains("another view"), "{title}");
    world.insert_resource(Viewpoint::default());
    world.insert_resource(Film::new(size + 1, 0));
    assert!(shown(&mut world).0, "of another size");
    world.insert_resource(Film::new(size, 0));
    assert_eq!(shown(&mut world), (false, true, PixelView::Error.title()), "back again");
}
