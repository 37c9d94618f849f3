//! How places and triangulations are written to the cache: as plain numbers.

use super::super::sphere::{SphereMesh, SurfacePoint};
use glam::DVec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// For `#[serde(with = "surface_points")]`.
pub(super) mod surface_points {
    use super::*;

    pub fn serialize<S: Serializer>(points: &[SurfacePoint], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(points.iter().map(|point| (point.face, point.barycentric.to_array())))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<SurfacePoint>, D::Error> {
        let points = Vec::<(u32, [f64; 3])>::deserialize(deserializer)?;
        let point = |(face, weights)| SurfacePoint { face, barycentric: DVec3::from_array(weights) };
        Ok(points.into_iter().map(point).collect())
    }
}

/// For `#[serde(with = "sphere_mesh")]`.
pub(super) mod sphere_mesh {
    use super::*;

    type Plain = (Vec<[f64; 3]>, Vec<[u32; 3]>, Vec<[u32; 3]>);

    pub fn serialize<S: Serializer>(mesh: &SphereMesh, serializer: S) -> Result<S::Ok, S::Error> {
        let directions: Vec<[f64; 3]> = mesh.directions.iter().map(|d| d.to_array()).collect();
        (directions, &mesh.triangles, &mesh.neighbours).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<SphereMesh, D::Error> {
        let (directions, triangles, neighbours) = Plain::deserialize(deserializer)?;
        Ok(SphereMesh { directions: directions.into_iter().map(DVec3::from_array).collect(), triangles, neighbours })
    }
}
