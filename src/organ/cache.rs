//! Built organs on disk, by content.

use super::build::{BuiltOrgan, OrganOptions};
use super::mesh::SurfaceMesh;
use bevy::reflect::Reflect;
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use tracing::warn;

/// Files begin with this; its last byte counts the versions of the format and of the algorithms.
const MAGIC: &[u8; 8] = b"SurgOrg\x01";
/// The oldest are deleted beyond this number.
const MOST_FILES: usize = 64;

/// Where built organs are kept between runs.
///
/// The default is the user's cache folder, or the folder that the environment variable `BEVY_SURGERY_CACHE` names;
/// `off` there switches the cache off. An organ is found by its surface and options, never by its file's name or age,
/// and a damaged file is made anew.
#[derive(Clone, Debug, PartialEq, Eq, Reflect)]
pub struct OrganCache {
    folder: Option<PathBuf>,
}

impl Default for OrganCache {
    fn default() -> Self {
        match std::env::var_os("BEVY_SURGERY_CACHE") {
            Some(value) if value == "off" => Self::off(),
            Some(value) => Self::in_folder(PathBuf::from(value)),
            None => Self { folder: dirs::cache_dir().map(|folder| folder.join("bevy_surgery").join("organs")) },
        }
    }
}

impl OrganCache {
    /// Keeps nothing.
    pub fn off() -> Self {
        Self { folder: None }
    }

    /// Keeps organs in this folder, which is made when needed.
    pub fn in_folder(folder: impl Into<PathBuf>) -> Self {
        Self { folder: Some(folder.into()) }
    }

    /// What an organ is found by: a hash of the surface and of everything that shapes it.
    pub(super) fn key(&self, mesh: &SurfaceMesh, options: &OrganOptions) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(MAGIC);
        hasher.update(env!("CARGO_PKG_VERSION").as_bytes());
        hasher.update(&(mesh.positions_m.len() as u64).to_le_bytes());
        hasher.update(bytemuck::cast_slice(&mesh.positions_m));
        hasher.update(&(mesh.triangles.len() as u64).to_le_bytes());
        hasher.update(bytemuck::cast_slice(&mesh.triangles));
        hasher.update(bytemuck::cast_slice(mesh.uvs.as_deref().unwrap_or_default()));
        // How the file was read has done its work; the table is made anew each time.
        let shaping = postcard::to_stdvec(&(&options.chart, &options.texture_mesh));
        hasher.update(&shaping.unwrap_or_default());
        hasher.finalize().to_hex().to_string()
    }

    fn file(&self, key: &str) -> Option<PathBuf> {
        self.folder.as_ref().map(|folder| folder.join(format!("{key}.organ")))
    }

    pub(super) fn load(&self, key: &str) -> Option<BuiltOrgan> {
        let file = self.file(key)?;
        let bytes = std::fs::read(&file).ok()?;
        let parts = decode(&bytes);
        if parts.is_none() {
            warn!("{}: damaged; the organ is made anew", file.display());
        }
        parts
    }

    pub(super) fn store(&self, key: &str, parts: &BuiltOrgan) {
        let (Some(folder), Some(file)) = (&self.folder, self.file(key)) else { return };
        if let Err(error) = write(folder, &file, parts) {
            warn!("{}: cannot keep a built organ here, loading stays slow: {error}", folder.display());
        }
    }
}

/// Magic, hash of what follows, the parts in postcard.
fn decode(bytes: &[u8]) -> Option<BuiltOrgan> {
    let body = bytes.strip_prefix(MAGIC)?;
    let (hash, body) = body.split_at_checked(32)?;
    if blake3::hash(body).as_bytes() != hash {
        return None;
    }
    postcard::from_bytes(body).ok()
}

fn write(folder: &Path, file: &Path, parts: &BuiltOrgan) -> std::io::Result<()> {
    let body = postcard::to_stdvec(parts).map_err(std::io::Error::other)?;
    std::fs::create_dir_all(folder)?;
    // Another process may be writing the same organ: only whole files get the final name.
    let unfinished = file.with_extension(format!("{}.part", std::process::id()));
    std::fs::write(&unfinished, [MAGIC.as_slice(), blake3::hash(&body).as_bytes(), &body].concat())?;
    std::fs::rename(&unfinished, file)?;
    forget_oldest(folder)
}

fn forget_oldest(folder: &Path) -> std::io::Result<()> {
    let mut files: Vec<(SystemTime, PathBuf)> = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "organ") {
            files.push((path.metadata()?.modified()?, path));
        }
    }
    files.sort();
    let surplus = files.len().saturating_sub(MOST_FILES);
    files[..surplus].iter().try_for_each(|(_, path)| std::fs::remove_file(path))
}
