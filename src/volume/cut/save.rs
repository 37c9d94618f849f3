//! Cuts as files.
//!
//! Little endian: 8 bytes of magic with the version, the grid's size (3 x u32), blake3 of the source volume (32 bytes,
//! [`Volume::content_hash`](super::super::Volume::content_hash)), the number of bricks (u32), blake3 of all that precedes and
//! follows (32 bytes), then deflated bricks: place (u32, ascending), and its 4096 numbers (f32) as four planes, all lowest
//! bytes first. Planes compress well where most numbers are 0 or 1.

use super::CutVolume;
use super::bricks::{SIDE, VOXELS, WHOLE};
use bevy::reflect::Reflect;
use flate2::{Compression, read::DeflateDecoder, write::DeflateEncoder};
use glam::UVec3;
use std::io::{Read, Write};
use std::sync::Arc;

const MAGIC: [u8; 7] = *b"BSURCUT";
const VERSION: u8 = 1;
const HASH_AT: usize = 8 + 12 + 32 + 4;
const HEADER: usize = HASH_AT + 32;

/// A saved cut that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Reflect, thiserror::Error)]
pub enum CutError {
    /// It does not begin as one.
    #[error("this is no saved cut")]
    NotACut,
    /// It was written by another version of this crate.
    #[error("a saved cut of version {0}; this program reads version {VERSION}")]
    Version(u8),
    /// It was drilled into another volume.
    #[error("this cut was drilled into another volume, of {saved} voxels; the one at hand has {here}")]
    OtherVolume {
        /// Size of the volume that it belongs to.
        saved: UVec3,
        /// Size of the volume at hand.
        here: UVec3,
    },
    /// It is incomplete, or bytes of it have changed.
    #[error("this saved cut is damaged: {0}")]
    Damaged(String),
}

impl CutVolume {
    /// The cut as bytes for a file, without its undo history; `volume_hash` says which volume it belongs to
    /// ([`Volume::content_hash`](super::super::Volume::content_hash)).
    pub fn save(&self, volume_hash: [u8; 32]) -> Vec<u8> {
        let bricks = self.bricks.list.iter().enumerate();
        let bricks = bricks.filter_map(|(place, brick)| Some((place as u32, brick.as_ref()?)));
        let bricks: Vec<_> = bricks.filter(|(_, brick)| ***brick != WHOLE).collect();
        let mut bytes = Vec::from(MAGIC);
        bytes.push(VERSION);
        for side in self.size().to_array() {
            bytes.extend(side.to_le_bytes());
        }
        bytes.extend(volume_hash);
        bytes.extend((bricks.len() as u32).to_le_bytes());
        bytes.extend([0; 32]);
        let mut deflated = DeflateEncoder::new(bytes, Compression::new(4));
        let mut planes = vec![0; VOXELS * 4];
        for (place, brick) in bricks {
            for (voxel, remaining) in brick.as_flattened().iter().enumerate() {
                for (plane, byte) in remaining.to_le_bytes().into_iter().enumerate() {
                    planes[plane * VOXELS + voxel] = byte;
                }
            }
            // Writing to memory does not fail.
            let _ = deflated.write_all(&place.to_le_bytes()).and_then(|()| deflated.write_all(&planes));
        }
        let mut bytes = deflated.finish().unwrap_or_default();
        let hash = content_hash(&bytes);
        bytes[HASH_AT..HEADER].copy_from_slice(&hash);
        bytes
    }

    /// Reads a saved cut of a volume with this size and hash. It begins without undo history.
    ///
    /// # Errors
    /// [`CutError`]: another volume's, another version's, or not what was saved. Memory is taken only for bricks that are
    /// there, at most as many as the volume has.
    pub fn load(bytes: &[u8], size: UVec3, volume_hash: [u8; 32]) -> Result<Self, CutError> {
        let damaged = |reason: &str| Err(CutError::Damaged(reason.into()));
        if bytes.first_chunk() != Some(&MAGIC) {
            return Err(CutError::NotACut);
        }
        match bytes.get(7) {
            Some(&VERSION) => {}
            Some(&version) => return Err(CutError::Version(version)),
            None => return damaged("it ends within its header"),
        }
        if bytes.len() < HEADER {
            return damaged("it ends within its header");
        }
        if bytes[HASH_AT..HEADER] != content_hash(bytes) {
            return damaged("its checksum does not match");
        }
        let number = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let saved = UVec3::new(number(8), number(12), number(16));
        if saved != size || bytes[20..52] != volume_hash {
            return Err(CutError::OtherVolume { saved, here: size });
        }
        let mut cut = Self::new(size);
        let mut inflated = DeflateDecoder::new(&bytes[HEADER..]);
        let mut next = 0;
        let mut stored = vec![0; 4 + VOXELS * 4];
        for _ in 0..number(52) {
            if let Err(error) = inflated.read_exact(&mut stored) {
                return damaged(&format!("its bricks end early ({error})"));
            }
            let (place, planes) = stored.split_at(4);
            let place = u32::from_le_bytes([place[0], place[1], place[2], place[3]]) as usize;
            if place < next || place >= cut.bricks.list.len() {
                return damaged("a brick is out of place");
            }
            next = place + 1;
            let mut brick = WHOLE;
            for (voxel, remaining) in brick.as_flattened_mut().iter_mut().enumerate() {
                *remaining = f32::from_le_bytes(std::array::from_fn(|plane| planes[plane * VOXELS + voxel]));
            }
            let bounds = cut.bricks.bounds(place);
            let is_inside = |voxel: usize| {
                let at = UVec3::new((voxel % SIDE) as u32, (voxel / SIDE % SIDE) as u32, (voxel / SIDE / SIDE) as u32);
                (bounds.min + at).cmplt(bounds.max).all()
            };
            for (voxel, &remaining) in brick.as_flattened().iter().enumerate() {
                if !(0.0..=1.0).contains(&remaining) || remaining != 1.0 && !is_inside(voxel) {
                    return damaged(&format!("a voxel's remaining opacity is {remaining}"));
                }
            }
            cut.bricks.list[place] = Some(Arc::new(brick));
        }
        match inflated.read(&mut [0]) {
            Ok(0) => Ok(cut),
            _ => damaged("something follows its bricks"),
        }
    }
}

/// blake3 of a saved cut but for the hash itself.
fn content_hash(bytes: &[u8]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&bytes[..HASH_AT]).update(&bytes[HEADER..]);
    *hasher.finalize().as_bytes()
}
