//! 128 bits that tell scenes apart, and whole files from damaged ones.

use crate::scene::{Glossy, TriangleMesh};
use crate::trace::TraceScene;
use crate::trace::light::FlatLight;
use glam::DVec3;
use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;

/// A hash that is the same on every machine and in every version: FNV-1a with 128 bits (Fowler, Noll, Vo;
/// RFC 9923) over words of eight bytes. Each step is a bijection of its state, so that two inputs that
/// differ in one word never agree. It finds accidents, not forgeries.
#[derive(Clone, Debug)]
pub struct Fingerprint(u128);

impl Default for Fingerprint {
    fn default() -> Self {
        Self(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d)
    }
}

impl Fingerprint {
    fn word(&mut self, word: u64) {
        const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;
        self.0 = (self.0 ^ u128::from(word)).wrapping_mul(PRIME);
    }

    /// Takes in `bytes`, and how many they are.
    pub fn bytes(&mut self, bytes: &[u8]) {
        let (words, rest) = bytes.as_chunks::<8>();
        for word in words {
            self.word(u64::from_le_bytes(*word));
        }
        let mut last = [0; 8];
        last[..rest.len()].copy_from_slice(rest);
        self.word(u64::from_le_bytes(last));
        self.word(bytes.len() as u64);
    }

    /// Takes in what `value` shows for debugging: all its fields, also those to come.
    fn debug(&mut self, value: &impl fmt::Debug) {
        self.bytes(format!("{value:?}").as_bytes());
    }

    /// The 128 bits so far.
    #[must_use]
    pub fn finish(&self) -> u128 {
        // The last words have reached few bits yet.
        let mut end = self.clone();
        for _ in 0..4 {
            end.word((end.0 >> 64) as u64);
        }
        end.0
    }

    /// Of all that a picture depends on except camera and settings: what rays hit, what that is made of,
    /// what shines, and where render space has its origin.
    #[must_use]
    pub fn of_scene(scene: &TraceScene, origin: DVec3) -> u128 {
        let mut print = Self::default();
        print.debug(&origin);
        let mut numbers = HashMap::new();
        let placements = scene.geometry.tlas.placements();
        print.word(placements.len() as u64);
        for (instance, placement) in scene.geometry.instances.iter().zip(placements) {
            // A mesh counts once, however many instances it has.
            let next = numbers.len() as u64;
            let number = *numbers.entry(Arc::as_ptr(&instance.mesh)).or_insert(next);
            print.word(number);
            if number == next {
                print.mesh(&instance.mesh);
            }
            print.bytes(bytemuck::cast_slice(&instance.materials));
            print.debug(placement.world_from_local());
        }
        for surface in &scene.surfaces.materials {
            // Its entities are only names; the textures are told by their numbers.
            let mut material = surface.material.clone();
            (material.base_color_texture, material.emission_texture, material.normal_map) =
                (None, None, None);
            if let Glossy::Ggx { texture, .. } | Glossy::BlinnPhong { texture, .. } = &mut material.glossy {
                *texture = None;
            }
            print.debug(&material);
            print.debug(&[surface.base_color_texture, surface.glossy_texture, surface.emission_texture]);
            print.debug(&(&surface.normal_map, &surface.layers));
        }
        for texture in &scene.surfaces.textures {
            print.debug(&(texture.texels.width, texture.texels.height));
            print.debug(&(texture.encoding, texture.wrap, texture.filter));
            print.bytes(texture.texels.texels.as_flattened());
        }
        for light in 0..scene.lights.len() as u32 {
            match scene.lights.get(light) {
                FlatLight::Mesh(mesh) => {
                    print.debug(&(mesh.instance, mesh.two_sided, mesh.mirrored));
                    print.bytes(bytemuck::cast_slice(&mesh.triangles));
                    print.bytes(bytemuck::cast_slice(&mesh.cumulative));
                }
                light => print.debug(light),
            }
        }
        print.finish()
    }

    fn mesh(&mut self, mesh: &TriangleMesh) {
        let TriangleMesh { positions, normals, uvs, second_uvs, tangents, colors, triangles, slots } = mesh;
        self.bytes(bytemuck::cast_slice(positions));
        self.bytes(bytemuck::cast_slice(normals));
        self.bytes(bytemuck::cast_slice(uvs));
        self.bytes(bytemuck::cast_slice(second_uvs));
        self.bytes(bytemuck::cast_slice(tangents));
        self.bytes(bytemuck::cast_slice(colors));
        self.bytes(bytemuck::cast_slice(triangles));
        self.bytes(bytemuck::cast_slice(slots));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(bytes: &[u8]) -> u128 {
        let mut print = Fingerprint::default();
        print.bytes(bytes);
        print.finish()
    }

    #[test]
    fn every_bit_and_every_length_counts() {
        let mut seen = std::collections::HashSet::new();
        for length in 0..40 {
            let mut bytes = vec![0; length];
            assert!(seen.insert(of(&bytes)), "{length} zeros");
            for bit in 0..length * 8 {
                bytes[bit / 8] ^= 1 << (bit % 8);
                assert!(seen.insert(of(&bytes)), "bit {bit} of {length} bytes");
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
        }
    }

    #[test]
    fn it_stays_what_it_is() {
        assert_eq!(format!("{:032x}", of(b"penumbra film")), "a235d33494fae573b9b52f4049a29a3f");
    }
}
