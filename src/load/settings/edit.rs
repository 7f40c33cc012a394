//! The `[[edit]]` tables: what was changed in the window, by the names of things.

use super::{Check, Settings};
use crate::load::error::LoadError;
use crate::load::report::Sink;
use crate::load::{LoadOptions, LoadReport, pose};
use crate::scene::path::{children, find};
use crate::scene::{ByHand, Glossy, Hidden, Instance, Light, Material, Transform, Visible};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DMat4, DVec4, Vec3};
use serde::{Deserialize, Serialize};
use toml::Spanned;

/// One changed thing. What is missing stays as it is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EditTable {
    /// Where the scene was counted from when it was edited, whatever the edits make of its extent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<[f64; 3]>,
    /// Names from the root down: see [`crate::scene::path`]. Empty: no thing is meant.
    #[serde(default)]
    pub entity: Vec<String>,
    /// It is made first, as a copy of this one and of all that moves with it, beside it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub copy_of: Option<Vec<String>>,
    /// Its placement in its parent, rows first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub matrix: Option<[[f64; 4]; 4]>,
    /// Whether it is left out of the picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hidden: Option<bool>,
    /// The light that it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light: Option<LightEdit>,
    /// Which of its materials `material` is about.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slot: Option<usize>,
    /// Values of that material, for all that use it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<MaterialEdit>,
}

/// Values of a [`Light`]; those that its kind does not have are ignored.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LightEdit {
    /// Intensity, irradiance, strength or radiance, at all of its corners or ends.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub spectra: Vec<[f32; 3]>,
    /// Radius, half length, or angles in radians.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sizes: Vec<f32>,
    /// The whole edges of a parallelogram: their lengths alone would round.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edges: Option<[[f32; 3]; 2]>,
}

/// Values of a [`Material`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(missing_docs, reason = "as of the material")]
pub struct MaterialEdit {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_color: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metallic: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specular: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exponent: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mirror: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emission: Option<[f32; 3]>,
}

impl MaterialEdit {
    /// All values that a material has.
    #[must_use]
    pub fn of(material: &Material) -> Self {
        let mut edit = Self {
            base_color: Some(material.base_color.to_array()),
            mirror: Some(material.mirror.to_array()),
            emission: Some(material.emission.to_array()),
            ..Self::default()
        };
        match material.glossy {
            Glossy::None => {}
            Glossy::BlinnPhong { specular, exponent, .. } => {
                (edit.specular, edit.exponent) = (Some(specular.to_array()), Some(exponent));
            }
            Glossy::Ggx { metallic, roughness, .. } => {
                (edit.metallic, edit.roughness) = (Some(metallic), Some(roughness));
            }
        }
        edit
    }

    fn apply(&self, material: &mut Material, check: &mut Check) {
        let color = |check: &mut Check, key: &str, value: Option<[f32; 3]>, old: Vec3| {
            value.map_or(old, |value| check.color(key, value))
        };
        material.base_color = color(check, "base_color", self.base_color, material.base_color);
        material.mirror = color(check, "mirror", self.mirror, material.mirror);
        material.emission =
            self.emission.map_or(material.emission, |emission| check.spectrum("emission", emission));
        match &mut material.glossy {
            Glossy::None => {}
            Glossy::BlinnPhong { specular, exponent, .. } => {
                *specular = color(check, "specular", self.specular, *specular);
                *exponent = self.exponent.unwrap_or(*exponent);
                check.that(exponent.is_finite() && *exponent >= 0.0, || {
                    "exponent must be 0 or more".to_owned()
                });
            }
            Glossy::Ggx { metallic, roughness, .. } => {
                *metallic = check.unit("metallic", self.metallic.unwrap_or(*metallic));
                *roughness = check.unit("roughness", self.roughness.unwrap_or(*roughness));
            }
        }
    }
}

impl LightEdit {
    /// All values that a light has.
    #[must_use]
    pub fn of(light: &Light) -> Self {
        let mut copy = light.clone();
        let spectra = spectra(&mut copy).into_iter().map(|s| s.to_array()).collect();
        match light {
            Light::Parallelogram { edge_u, edge_v, .. } => {
                let edges = Some([edge_u.to_array(), edge_v.to_array()]);
                Self { spectra, sizes: Vec::new(), edges }
            }
            _ => Self { spectra, sizes: sizes(light), edges: None },
        }
    }

    /// Makes `light` have these values; false if their number is that of another kind.
    #[must_use]
    pub fn apply(&self, light: &mut Light) -> bool {
        let mut places = spectra(light);
        let fits = self.spectra.is_empty() || places.len() == self.spectra.len();
        for (place, &value) in places.iter_mut().zip(&self.spectra) {
            **place = value.into();
        }
        if let (Some([u, v]), Light::Parallelogram { edge_u, edge_v, .. }) = (self.edges, &mut *light) {
            (*edge_u, *edge_v) = (u.into(), v.into());
        }
        fits && (self.sizes.is_empty() || set_sizes(light, &self.sizes))
    }

    fn check(&self, check: &mut Check) {
        if let Some([u, v]) = self.edges.map(|edges| edges.map(Vec3::from)) {
            let area = u.cross(v).length();
            check.that(area > 0.0 && area.is_finite(), || "edges must span an area".to_owned());
        }
        for &spectrum in &self.spectra {
            check.spectrum("spectra", spectrum);
        }
        for &size in &self.sizes {
            check
                .that(size.is_finite() && size >= 0.0, || "sizes must be finite and not negative".to_owned());
        }
    }
}

/// Everything about a light that is a spectrum.
pub fn spectra(light: &mut Light) -> Vec<&mut Vec3> {
    match light {
        Light::Point { intensity } | Light::Spot { intensity, .. } => vec![intensity],
        Light::Directional { irradiance, .. } => vec![irradiance],
        Light::Segment { strength, .. } => strength.iter_mut().collect(),
        Light::Parallelogram { radiance, .. } => radiance.iter_mut().collect(),
        Light::Disk { radiance, .. } | Light::Sphere { radiance, .. } | Light::Environment { radiance } => {
            vec![radiance]
        }
        Light::Sky { scale, .. } => vec![scale],
    }
}

/// How large it is: see [`LightEdit::sizes`].
#[must_use]
pub fn sizes(light: &Light) -> Vec<f32> {
    match light {
        Light::Point { .. } | Light::Environment { .. } | Light::Sky { .. } => Vec::new(),
        Light::Spot { inner_angle, outer_angle, .. } => vec![*inner_angle, *outer_angle],
        Light::Directional { angle, .. } => vec![*angle],
        Light::Segment { half_length, .. } => vec![*half_length],
        Light::Parallelogram { edge_u, edge_v, .. } => vec![edge_u.length(), edge_v.length()],
        Light::Disk { radius, .. } | Light::Sphere { radius, .. } => vec![*radius],
    }
}

/// Makes it that large; false if a light of this kind has another number of sizes, or such a size is no size.
pub fn set_sizes(light: &mut Light, wanted: &[f32]) -> bool {
    let positive = |size: f32| size > 0.0 && size.is_finite();
    match (light, wanted) {
        (Light::Spot { inner_angle, outer_angle, .. }, &[inner, outer])
            if inner >= 0.0 && inner <= outer && outer <= std::f32::consts::FRAC_PI_2 =>
        {
            (*inner_angle, *outer_angle) = (inner, outer);
            true
        }
        (Light::Directional { angle, .. }, &[wanted]) if (0.0..=std::f32::consts::PI).contains(&wanted) => {
            *angle = wanted;
            true
        }
        (Light::Segment { half_length: size, .. }, &[wanted])
        | (Light::Disk { radius: size, .. } | Light::Sphere { radius: size, .. }, &[wanted])
            if positive(wanted) =>
        {
            *size = wanted;
            true
        }
        (Light::Parallelogram { edge_u, edge_v, .. }, &[u, v]) if positive(u) && positive(v) => {
            // The same length again must be the same edge, to the bit.
            for (edge, length) in [(edge_u, u), (edge_v, v)] {
                if edge.length() != length {
                    *edge *= length / edge.length();
                }
            }
            true
        }
        (_, sizes) => sizes.is_empty(),
    }
}

/// The placement as rows.
#[must_use]
pub fn rows_of(transform: &Transform) -> [[f64; 4]; 4] {
    DMat4::from(transform.0).transpose().to_cols_array_2d()
}

/// What was edited in a scene. It comes after all that the program decides by the scene's extent and lights, since who
/// edits it has that before his eyes; and after the animations, so that what is moved by hand stands where it was put.
#[derive(Default)]
pub(crate) struct Edits(pub(in crate::load) Vec<Settings>);

impl Edits {
    fn tables(&self) -> impl Iterator<Item = (&Settings, &Spanned<EditTable>)> {
        self.0.iter().flat_map(|settings| settings.tables.edit.iter().map(move |table| (settings, table)))
    }

    /// Whether nothing was edited.
    pub(crate) fn is_empty(&self) -> bool {
        self.tables().next().is_none()
    }

    /// See [`EditTable::origin`].
    pub(in crate::load) fn origin(&self) -> Option<[f64; 3]> {
        self.tables().filter_map(|(_, table)| table.get_ref().origin).last()
    }

    /// Changes the scene that was loaded with `options`, and adds to its report.
    ///
    /// # Errors
    /// What about an edit is wrong; then some of them may have been made.
    pub(crate) fn apply(
        &self,
        world: &mut World,
        options: &LoadOptions,
        report: &mut LoadReport,
    ) -> Result<(), LoadError> {
        let mut sink = Sink::new(world, options);
        std::mem::swap(&mut sink.report, report);
        let made = self.make(&mut sink);
        std::mem::swap(&mut sink.report, report);
        made
    }

    /// Changes what the tables say. One that speaks of something that is not there is a warning.
    pub(in crate::load) fn make(&self, sink: &mut Sink<'_>) -> Result<(), LoadError> {
        self.tables().try_for_each(|(settings, table)| apply(settings, table, sink))?;
        pose(sink.world);
        Ok(())
    }
}

fn apply(settings: &Settings, table: &Spanned<EditTable>, sink: &mut Sink<'_>) -> Result<(), LoadError> {
    let edit = table.get_ref();
    let path = edit.entity.join("/");
    let place = format!("[[edit]] of \"{path}\"");
    match change(sink.world, edit) {
        Ok(Changed::Nothing) if path.is_empty() => {}
        Ok(Changed::Nothing) => {
            sink.ignored(&settings.file, &place, "there is no such thing in the scene");
        }
        Ok(Changed::Old) => {}
        Ok(Changed::New(copies)) => copies.into_iter().for_each(|(_, copy)| sink.note_spawned(copy)),
        Err(problem) => return Err(settings.broken(table, &place, problem)),
    }
    let slot = edit.slot.unwrap_or(0);
    let instance = find(sink.world, &edit.entity).and_then(|thing| sink.world.get::<Instance>(thing));
    if edit.material.is_some() && instance.is_none_or(|instance| instance.materials.len() <= slot) {
        sink.ignored(&settings.file, &place, format!("it has no material in slot {slot}"));
    }
    Ok(())
}

/// What an edit was about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Changed {
    /// Something that is not there.
    Nothing,
    /// Something that was there.
    Old,
    /// A copy: what it is of and itself, and so for all that moves with it. See [`duplicate`].
    New(Vec<(Entity, Entity)>),
}

/// Changes the world as `edit` says.
///
/// # Errors
/// What about it is wrong.
pub fn change(world: &mut World, edit: &EditTable) -> Result<Changed, String> {
    let mut check = Check::default();
    let mut matrix = None;
    if let Some(rows) = edit.matrix {
        let m = DMat4::from_cols_array_2d(&rows).transpose();
        check.that(m.is_finite() && m.row(3) == DVec4::W, || {
            "matrix must be finite with the last row [0, 0, 0, 1]".to_owned()
        });
        matrix = Some(Transform(DAffine3::from_mat4(m)));
    }
    if let Some(light) = &edit.light {
        light.check(&mut check);
    }
    if let Some(origin) = edit.origin {
        check.point("origin", origin);
    }
    let name = edit.entity.last().map_or("copy", String::as_str);
    let (entity, changed) = match &edit.copy_of {
        Some(original) => match find(world, original) {
            Some(original) => {
                let copies = duplicate(world, original, name);
                (copies[0].1, Changed::New(copies))
            }
            None => return Ok(Changed::Nothing),
        },
        None => match find(world, &edit.entity) {
            Some(entity) => (entity, Changed::Old),
            None => return check.problem.map_or(Ok(Changed::Nothing), Err),
        },
    };
    let mut place = world.entity_mut(entity);
    if let Some(matrix) = matrix {
        place.insert((matrix, ByHand));
    }
    match edit.hidden {
        Some(true) => drop(place.insert(Hidden)),
        Some(false) => drop(place.remove::<Hidden>()),
        None => {}
    }
    if let (Some(values), Some(mut light)) = (&edit.light, place.get_mut::<Light>()) {
        check.that(values.apply(&mut light), || {
            "light: spectra or sizes are not those of its kind".to_owned()
        });
    }
    if let Some(values) = &edit.material {
        let slot = edit.slot.unwrap_or(0);
        let material = place.get::<Instance>().and_then(|instance| instance.materials.get(slot).copied());
        if let Some(mut material) = material.and_then(|m| world.get_mut::<Material>(m)) {
            values.apply(&mut material, &mut check);
        }
    }
    check.problem.map_or(Ok(changed), Err)
}

/// Spawns another like `original`, beside it and called `name`, with all that moves with it: each of them and its copy, parents
/// before their children.
pub fn duplicate(world: &mut World, original: Entity, name: &str) -> Vec<(Entity, Entity)> {
    let parent = world.get::<ChildOf>(original).map(ChildOf::parent);
    // A copy is seen; but what is left out of a thing that is seen, its copy is without, too.
    let is_hidden = world.get::<Hidden>(original).is_some();
    let top = twin(world, original, Name::new(name.to_owned()), parent);
    let mut copies = vec![(original, top)];
    let mut next = 0;
    while let Some(&(above, copy_above)) = copies.get(next) {
        next += 1;
        for child in children(world, above).into_iter().filter(|&child| child != top) {
            let name = world.get::<Name>(child).cloned().unwrap_or_default();
            let copy = twin(world, child, name, Some(copy_above));
            if !is_hidden && world.get::<Hidden>(child).is_some() {
                world.entity_mut(copy).insert(Hidden);
            }
            copies.push((child, copy));
        }
    }
    copies
}

/// Another one like it, without its children.
fn twin(world: &mut World, original: Entity, name: Name, parent: Option<Entity>) -> Entity {
    let place = world.get::<Transform>(original).copied().unwrap_or_default();
    let instance = world.get::<Instance>(original).cloned();
    let light = world.get::<Light>(original).cloned();
    let visible = world.get::<Visible>(original).copied();
    let mut copy = world.spawn((name, place));
    if let Some(instance) = instance {
        copy.insert(instance);
    }
    if let Some(light) = light {
        copy.insert(light);
    }
    if let Some(visible) = visible {
        copy.insert(visible);
    }
    if let Some(parent) = parent {
        copy.insert(ChildOf(parent));
    }
    copy.id()
}
