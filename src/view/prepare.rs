//! The window's resources and systems in a world, and what it says of itself.

use super::bookmarks::{Bookmarks, recall, remember};
use super::cameras::{
    FileCameras, change_lens, change_projection, choose_camera, choose_side, survey_edited,
};
use super::controls::{
    Notices, Paused, change_display, change_pause, change_settings, change_shown, print_camera, save_picture,
};
use super::crop::change_region;
use super::debug::{CurrentLayer, Debug, DebugLines, change_debug, draw_layer, explain_pinned};
use super::edit::marks::{Marks, mark};
use super::edit::{Editor, edit_scene, finish_sync, start_sync};
use super::engine::Pending;
use super::fly::{FlySpeed, change_speed, fly_camera, look_around, take_off};
use super::input::Input;
use super::instrument::{Instrument, note_noise};
use super::orbit::{Navigation, change_navigation, focus, orbit_camera};
use super::pixel_view::{
    CurrentLegend, DepthWanted, FirstHits, PixelView, Unknown, choose_developed, choose_pixel_view,
    develop_pixel_view, refine_first_hits,
};
use super::plain::{Plain, develop_plain};
use super::playing::{Clock, advance};
use super::sides::{Compared, Sides, change_sides, develop_side};
use super::status::{Machine, Status};
use crate::app::{App, FrameBudget, FrameStats, FrameSystems, trace_frame};
use crate::image::Display;
use crate::open::LoadCard;
use crate::scene::{ActiveCamera, Playing, SceneBounds, propagate_transforms};
use crate::shown::Shown;
use crate::sync::{Redone, build_blas, reset_film};
use crate::trace::film::Pixel;
use crate::trace::{Film, Geometry, Lights, RenderSettings};
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce;
use glam::DVec3;
use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Speed at the start, in radii of the scene per second.
const RADII_PER_SECOND: f64 = 0.5;

/// Adds the window's resources and systems.
pub fn prepare(app: &mut App, interrupt: &Arc<AtomicBool>) {
    let mut budget = app.world.resource_mut::<FrameBudget>();
    budget.interrupt = Arc::clone(interrupt);
    budget.preview = true;
    let shows_light = app.world.get_resource::<PixelView>().is_none_or(|view| *view == PixelView::Beauty);
    app.world.resource_mut::<FrameBudget>().develop = shows_light;
    // The camera may be asked for its place before the first frame has run.
    let propagated = app.world.run_system_once(propagate_transforms);
    debug_assert!(propagated.is_ok());
    let camera = app.world.resource::<ActiveCamera>().0;
    if !app.world.contains_resource::<FileCameras>() {
        app.world.insert_resource(FileCameras { home: camera, last: camera });
    }
    if !app.world.contains_resource::<Input>() {
        app.world.insert_resource(Input::new(Instant::now()));
    }
    app.world.init_resource::<Paused>();
    app.world.init_resource::<Clock>();
    app.world.init_resource::<Notices>();
    app.world.init_resource::<Plain>();
    app.world.init_resource::<Sides>();
    app.world.init_resource::<Compared>();
    app.world.init_resource::<Held>();
    app.world.init_resource::<Bookmarks>();
    app.world.init_resource::<Pending>();
    app.world.init_resource::<PixelView>();
    app.world.init_resource::<CurrentLegend>();
    app.world.init_resource::<Unknown>();
    app.world.init_resource::<DepthWanted>();
    app.world.init_resource::<FirstHits>();
    app.world.init_resource::<Debug>();
    app.world.init_resource::<Editor>();
    app.world.init_resource::<Marks>();
    app.world.init_resource::<DebugLines>();
    app.world.init_resource::<CurrentLayer>();
    let pivot = app.world.get_resource::<SceneBounds>().map_or(DVec3::ZERO, |bounds| bounds.center);
    let vertical_fov = std::f32::consts::FRAC_PI_4;
    if !app.world.contains_resource::<Navigation>() {
        app.world.insert_resource(Navigation { orbiting: false, pivot, vertical_fov });
    }
    if !app.world.contains_resource::<FlySpeed>() {
        let radius = app.world.get_resource::<SceneBounds>().map_or(2.0, |bounds| bounds.radius);
        app.world.insert_resource(FlySpeed(RADII_PER_SECOND * radius));
    }
    app.add_systems(
        (
            develop_plain,
            change_region,
            change_settings,
            (change_sides, change_shown).chain(),
            save_picture,
            change_display,
            (change_pause, advance).chain(),
            (change_speed, change_navigation, choose_camera, take_off, recall, survey_edited, choose_side)
                .chain(),
            (change_projection, change_lens, focus, look_around, fly_camera, orbit_camera).chain(),
            (choose_pixel_view, change_debug, edit_scene).chain(),
        )
            .chain()
            .in_set(FrameSystems::Input),
    );
    // Where the camera is now, not where it was before it moved.
    app.add_systems((remember, print_camera).chain().in_set(FrameSystems::Sync));
    app.add_systems(refine_first_hits.in_set(FrameSystems::Trace).after(trace_frame));
    app.add_systems(start_sync.in_set(FrameSystems::Sync).before(build_blas));
    app.add_systems((finish_sync, mark).chain().in_set(FrameSystems::Sync).after(reset_film));
    app.add_systems(choose_developed.in_set(FrameSystems::Sync).after(reset_film));
    app.add_systems(count_held.in_set(FrameSystems::Trace));
    app.add_systems(explain_pinned.in_set(FrameSystems::Sync).after(reset_film));
    app.add_systems(
        (note_noise, develop_pixel_view, develop_side, draw_layer).chain().in_set(FrameSystems::Present),
    );
}

/// What the window is to show of `app` beside the picture.
#[must_use]
pub fn status(app: &App) -> Status {
    let world = &app.world;
    let stats = world.resource::<FrameStats>();
    let settings = world.resource::<RenderSettings>();
    let display = world.resource::<Display>();
    let shown = world.resource::<Shown>();
    Status {
        samples_per_pixel: stats.samples_per_pixel,
        sample_target: world.resource::<FrameBudget>().sample_target,
        done: stats.done,
        paused: world.resource::<Paused>().0,
        animation: world.get_resource::<Playing>().and_then(|playing| playing.time),
        noise: stats.noise.map(|noise| (noise, stats.noise_doubt)),
        graph: Arc::clone(&world.resource::<Instrument>().graph),
        legend: world.resource::<CurrentLegend>().0.clone(),
        debug: world.resource::<Debug>().status(),
        edit: world.resource::<Editor>().status(),
        unsaved: world.resource::<Editor>().is_unsaved(),
        rays_per_second: stats.rays_per_second,
        preview_scale: stats.preview_scale,
        kept: shown.kept_share(world.resource::<Film>().complete_samples(), stats.done),
        smoothed: shown.is_smoothed() && world.resource::<FrameBudget>().develop,
        region: world.resource::<FrameBudget>().region.map(|[min, max]| {
            let size = max - min;
            [min.x, min.y, size.x, size.y]
        }),
        card: world.get_resource::<LoadCard>().map_or_else(|| Arc::from(""), |card| Arc::clone(card.now())),
        machine: machine(world),
        resets: world.resource::<Redone>().resets,
        dropped: stats.dropped,
        exposure: display.exposure,
        tone_map: display.tone_map,
        speed: world.resource::<FlySpeed>().0,
        orbiting: world.resource::<Navigation>().orbiting,
        size: settings.size,
        integrator: settings.integrator,
        filter: settings.filter,
        isa: world.resource::<Geometry>().tlas.isa().name(),
    }
}

/// What the hierarchy holds, counted when it changes.
#[derive(Resource, Clone, Copy, Debug, Default)]
struct Held {
    triangles: usize,
    bytes: usize,
}

fn count_held(geometry: Res<Geometry>, mut held: ResMut<Held>) {
    if !geometry.is_changed() {
        return;
    }
    let mut meshes = HashSet::new();
    *held = Held::default();
    for (data, placement) in geometry.instances.iter().zip(geometry.tlas.placements()) {
        held.triangles += data.mesh.triangles.len();
        if meshes.insert(Arc::as_ptr(placement.blas())) {
            held.bytes += placement.blas().bytes();
        }
    }
}

fn machine(world: &World) -> Machine {
    let shown = world.resource::<Shown>();
    let held = world.resource::<Held>();
    let pixels = world.resource::<Film>().size().element_product() as usize;
    Machine {
        threads: rayon::current_num_threads(),
        counts: [
            world.resource::<Geometry>().instances.len(),
            held.triangles,
            world.resource::<Lights>().len(),
        ],
        bytes: [pixels * size_of::<Pixel>(), shown.bytes(), held.bytes],
        first_picture: [world.resource::<FrameStats>().preview_seconds, shown.seconds[0]],
        developing: shown.seconds[1],
    }
}
