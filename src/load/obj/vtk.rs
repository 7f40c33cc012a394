//! What VTK and `ParaView` mean by the statements of their MTL libraries.
//!
//! Their exporter (`vtkOBJExporter`) writes the opacity after `Tr`, the colour of highlights without its strength after `Ks`
//! (the strength is 0 unless somebody asks for more), and `illum 3` for everything.

/// Whether VTK wrote the library.
pub(super) fn is_by_vtk(text: &str) -> bool {
    text.lines().take(3).any(|line| line.contains("written by the visualization toolkit"))
}

/// Says a material again in the words of the format.
pub(super) fn restate(material: &mut tobj::Material) {
    if let Some(opacity) = material.unknown_param.remove("Tr") {
        material.dissolve = material.dissolve.or_else(|| opacity.parse().ok());
    }
    (material.specular, material.illumination_model) = (None, Some(2));
}

/// [`restate`], in a line.
pub(super) const WHAT: &str =
    "written by VTK: Tr says how opaque a surface is, Ks has no strength, illum 3 is no mirror";
