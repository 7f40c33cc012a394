//! What Blender means by the statements of its MTL libraries: parameters of its principled surface, in words that mean
//! something else to everybody else. They are said again in those of the PBR extension.
//!
//! Found by exporting materials of known parameters with Blender 5.0, and confirmed in files of 2.8 and 3.6: `Ns` is
//! (1 − roughness)² times 1000 (900 in 2.8; for 3.1 and 3.2 it is taken to be 900 too), `Ks` the strength of gloss, 0.5 being
//! that of `Ni` (before 4.0 that of an index of 1.5), illum 3 and 6 are metal by the share that `Ka` says, `Pc` is four times
//! the varnish, and `Tf` is there only for what lets light through. Numbers of what has a map are not written, or mean nothing.

use glam::Vec3;

/// The keyword under which a material carries the strength of its gloss, twice `Ks`.
pub(super) const GLOSS: &str = "Blender gloss";
/// And how much it lets through.
pub(super) const THROUGH: &str = "Blender transmission";

/// Which Blender wrote a library: major and minor number; 0, 0 is before 3.1, which doesn't say.
pub(super) type Version = (u32, u32);

/// The version of Blender that wrote the library, if it was Blender.
pub(super) fn version(text: &str) -> Option<Version> {
    let rest = text.lines().next()?.strip_prefix("# Blender ")?;
    let mut numbers = rest.split(['.', ' ']).map(str::parse);
    match (numbers.next(), numbers.next()) {
        (Some(Ok(major)), Some(Ok(minor))) => Some((major, minor)),
        _ => Some((0, 0)),
    }
}

/// Says again what Blender meant. Whether it did: what people have changed by hand since stays as it is.
pub(super) fn restate(material: &mut tobj::Material, version: Version) -> bool {
    let model = material.illumination_model.unwrap_or(2);
    // It writes no others, and these two only for what has an opacity.
    let is_clear = material.dissolve.is_none_or(|dissolve| dissolve >= 1.0);
    if !matches!(model, 0..=3 | 6 | 9)
        || matches!(model, 6 | 9) && is_clear && material.dissolve_texture.is_none()
    {
        return false;
    }
    let number = |material: &tobj::Material, keyword: &str| -> Option<f32> {
        material.unknown_param.get(keyword)?.split_ascii_whitespace().next()?.parse().ok()
    };
    let is_pbr = material.unknown_param.contains_key("Pm") || material.unknown_param.contains_key("Pr");
    let is_rough = material.shininess.is_some() || material.shininess_texture.is_some();
    let ambient = material.ambient.map_or(Vec3::ZERO, Vec3::from);
    let grey = |[r, g, b]: [f32; 3]| r == g && g == b;
    // A map of it stands alone.
    let said = material.specular.or(material.specular_texture.is_some().then_some([1.0; 3]));
    let Some([gloss, ..]) = said.filter(|&specular| grey(specular)) else { return false };
    let is_metal = matches!(model, 3 | 6);
    let is_black = material.diffuse == Some([0.0; 3]) && material.diffuse_texture.is_none();
    // Before 2.8 there was no such surface, and everything but glass was written with an index of 1.
    if version == (0, 0) && !is_pbr && material.optical_density.is_none_or(|ior| ior <= 1.0) {
        return false;
    }
    // A mirror that somebody made of it.
    if !is_pbr && (!is_rough || is_metal && (is_black || ambient.x <= 0.0 || !grey(ambient.to_array()))) {
        return false;
    }
    let mut say = |keyword: &str, value: f32| {
        material.unknown_param.insert(keyword.to_owned(), value.to_string());
    };
    if !is_pbr {
        let smoothest = if version < (3, 3) { 900.0 } else { 1000.0 };
        if let Some(exponent) = material.shininess.filter(|_| material.shininess_texture.is_none()) {
            say("Pr", 1.0 - (exponent / smoothest).clamp(0.0, 1.0).sqrt());
        }
        say("Pm", if is_metal { ambient.x.min(1.0) } else { 0.0 });
    }
    say(GLOSS, 2.0 * gloss.clamp(0.0, 1.0));
    if let Some(varnish) = number(material, "Pc") {
        material.unknown_param.insert("Pc".to_owned(), (0.25 * varnish).to_string());
    }
    if let Some(through) = number(material, "Tf").filter(|&through| through > 0.0) {
        material.unknown_param.insert(THROUGH.to_owned(), through.min(1.0).to_string());
        material.unknown_param.remove("Tf");
    }
    if version < (4, 0) && !material.unknown_param.contains_key(THROUGH) {
        material.optical_density = Some(1.5);
    }
    if let Some(map) = material.shininess_texture.take() {
        material.unknown_param.insert("map_Pr".to_owned(), map);
    }
    (material.shininess, material.illumination_model) = (None, Some(2));
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn restated(text: &str) -> (bool, tobj::Material) {
        let (materials, _) = tobj::load_mtl_buf(&mut text.as_bytes()).unwrap();
        let mut material = materials.into_iter().next().unwrap();
        (restate(&mut material, version(text).unwrap()), material)
    }

    #[test]
    fn only_blender_is_taken_for_blender() {
        assert_eq!(version("# Blender 3.6.0 MTL File: 'a.blend'\nnewmtl a"), Some((3, 6)));
        assert_eq!(version("# Blender MTL File: 'None'\n# Material Count: 1"), Some((0, 0)));
        for text in ["", "newmtl a", "# Exported for Blender", "# 3ds Max\n# Blender 3.6.0"] {
            assert_eq!(version(text), None, "{text}");
        }
    }

    /// As Blender 5.0.1 writes gold of roughness 0.3, and 2.93 its default material.
    #[test]
    fn what_was_exported_is_what_comes_back() {
        let gold = "# Blender 5.0.1 MTL File: 'None'\nnewmtl gold\nNs 490\nKa 1 1 1\nKd 1 0.77 0.34\nKs 0.5 0.5 0.5\n\
                    Ke 0 0 0\nNi 1.5\nd 1\nillum 3";
        let old = "# Blender MTL File: 'None'\nnewmtl a\nNs 225\nKa 1 1 1\nKd 0.8 0.8 0.8\nKs 0.5 0.5 0.5\nNi 1.45\nillum 2";
        for (text, roughness, metal) in [(gold, 0.3, 1.0), (old, 0.5, 0.0)] {
            let (is_so, material) = restated(text);
            let said = |keyword: &str| material.unknown_param[keyword].parse::<f32>().unwrap();
            assert!(is_so && (said("Pr") - roughness).abs() < 1e-6, "{}", said("Pr"));
            assert_eq!((said("Pm"), said(GLOSS)), (metal, 1.0));
            assert_eq!(material.illumination_model, Some(2));
        }
        let glass = "# Blender 5.0.1 MTL File: 'None'\nnewmtl g\nKd 1 1 1\nKs 0.25 0.25 0.25\nPr 0.1\nPm 0\nPc 2\nTf 0.5 0.5 0.5";
        let (_, material) = restated(glass);
        let said = |keyword: &str| material.unknown_param[keyword].parse::<f32>().unwrap();
        assert_eq!([said("Pr"), said("Pc"), said(THROUGH), said(GLOSS)], [0.1, 0.5, 0.5, 0.5]);
    }

    #[test]
    fn a_map_says_roughness_alone_and_nothing_is_below_zero() {
        let head = "# Blender 4.2.0 MTL File: 'None'\nnewmtl a\nNs 250\nKd 1 1 1\nNi 1.2\n";
        let (_, material) = restated(&format!("{head}Ks -20 -20 -20\nmap_Ns rough.png"));
        assert_eq!(material.unknown_param["map_Pr"], "rough.png");
        assert!(!material.unknown_param.contains_key("Pr") && material.shininess_texture.is_none());
        assert_eq!(material.unknown_param[GLOSS], "0");
        assert_eq!(material.optical_density, Some(1.2));
    }

    #[test]
    fn mirrors_made_by_hand_and_coloured_gloss_stay() {
        let head = "# Blender MTL File: 'None'\nnewmtl a\nNs 225\nKa 1 1 1\n";
        for rest in [
            "Ni 1.45\nKd 0 0 0\nKs 1 1 1\nillum 3",
            "Ni 1.5\nKd 0.1 0.1 0.1\nKs 0.9 0.9 0.9\nd 1\nillum 5",
            "Ni 1.5\nKd 0.1 0.1 0.1\nKs 0.5 0.5 0.5\nd 1\nillum 7",
            "Ni 1.5\nKd 0.1 0.1 0.1\nKs 0.5 0.5 0.5\nillum 9",
            "Ni 1.45\nKd 0.5 0.5 0.5\nKs 1 0.9 0.8\nillum 2",
            // As 2.78 writes its materials.
            "Ni 1\nKd 0.64 0.64 0.64\nKs 0.5 0.5 0.5\nillum 2",
        ] {
            assert!(!restated(&format!("{head}{rest}")).0, "{rest}");
        }
        assert!(
            !restated("# Blender MTL File: 'None'\nnewmtl a\nKd 0.5 0.2 0.2\nKs 1 1 1").0,
            "says nothing of roughness"
        );
    }
}
