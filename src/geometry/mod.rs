//! Where rays hit: rays, shapes, meshes, instances and the two-level tree over them.
//!
//! Everything is f64 except mesh vertices and tree boxes. No epsilon depends on the scale of the
//! scene: a ray that leaves a surface names the face (and root) it left.

pub mod accel;
mod analytic;
pub mod area;
mod batch;
pub mod coincident;
pub mod contact;
pub mod deforming;
pub mod endpoint;
pub mod facets;
mod gap;
pub mod hit;
pub mod instance;
pub mod lens;
pub mod mesh;
pub mod moment;
pub mod motion;
mod moving_tree;
pub mod pose;
pub mod ray;
pub mod shape;
pub mod shutter;
pub mod still;
pub mod track;
mod tree;
mod tree_build;
mod tree_walk;
mod triangles;

pub use accel::{Accel, AccelAt};
pub use area::AreaSampler;
pub use coincident::{Face, Faces};
pub use contact::Contact;
pub use deforming::Deforming;
pub use endpoint::{DirectionalDensity, EndPoint};
pub use facets::Facets;
pub use hit::{Hit, SurfaceId, SurfacePoint};
pub use instance::{Instance, InstanceId};
pub use lens::LensShape;
pub use mesh::MeshError;
pub use moment::{Moment, Placements};
pub use motion::{Link, Placement, Transform};
pub use pose::{Pose, Rotation};
pub use ray::Ray;
pub use shape::Shape;
pub use shutter::Shutter;
pub use still::Mesh;
