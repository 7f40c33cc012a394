//! What VTK and `ParaView` mean by the statements of their MTL libraries.
//!
//! Their exporter (`vtkOBJExporter`) writes the opacity after `Tr`, and `illum 3` for everything. Old versions write bare
//! colours after `Ka` and `Ks`, without their strengths (which are 0 unless somebody asks for more); new ones multiply them.

/// Whether VTK wrote the library.
pub(super) fn is_by_vtk(text: &str) -> bool {
    text.lines().take(3).any(|line| line.contains("written by the visualization toolkit"))
}

/// Says a material again in the words of the format.
pub(super) fn restate(material: &mut tobj::Material) {
    if let Some(opacity) = material.unknown_param.remove("Tr") {
        material.dissolve = material.dissolve.or_else(|| opacity.parse().ok());
    }
    // What surrounds has no strength unless somebody asks for it: if it has a colour all the same, that is bare.
    if material.ambient.is_some_and(|ambient| ambient != [0.0; 3]) {
        material.specular = None;
    }
    material.illumination_model = Some(2);
}

/// [`restate`], in a line.
pub(super) const WHAT: &str = "written by VTK: Tr says how opaque a surface is, illum 3 is no mirror, and Ks beside a bright Ka has no strength";
