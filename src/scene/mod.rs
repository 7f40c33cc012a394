//! What is there: the components of the scene's entities. No rays, no files.
//!
//! Everything is linear: lengths in scene units (glTF: metres), angles in radians, colours and
//! radiances as linear RGB with Rec. 709 primaries. The world is right-handed, +Y up.

pub mod animation;
pub mod bounds;
pub mod camera;
pub mod color;
pub mod deform;
pub mod hidden;
pub mod layers;
pub mod light;
pub mod material;
pub mod mesh;
pub mod path;
mod sky;
pub mod texture;
pub mod transform;

pub use animation::{
    Animation, ByHand, Channel, Curve, Interpolation, MorphWeights, Playing, Pose, Property, play,
};
pub use bounds::SceneBounds;
pub use camera::{ActiveCamera, Aspect, Camera, Lens, Projection};
pub use deform::{Deform, Influences, Skin, Target, deform};
pub use hidden::Hidden;
pub use layers::{Anisotropy, Body, Clearcoat, Layers, Sheen, Transmission};
pub use light::{Emission, Light, Visible};
pub use material::{Alpha, Glass, Glossy, Material, NormalMap, TextureUse};
pub use mesh::{Instance, Mesh, TriangleMesh};
pub use sky::{Sky, rotation};
pub use texture::{Encoding, Filter, Texels, Texture, Wrap};
pub use transform::{GlobalTransform, Transform, propagate_transforms};
