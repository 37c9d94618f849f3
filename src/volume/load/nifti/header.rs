//! Headers of both versions, as one.

use crate::volume::error::VolumeFault;
use crate::volume::load::samples::ByteOrder;
use crate::volume::load::source::Source;
use crate::volume::load::{VolumeFormat, malformed};
use glam::DVec3;
use nifti::{Endianness, NiftiHeader};

/// What both versions say, in the wider types of the second.
pub(super) struct Header {
    pub(super) format: VolumeFormat,
    /// Bytes of the header itself.
    pub(super) bytes: u64,
    pub(super) order: ByteOrder,
    /// Whether the voxels are in the same file.
    pub(super) is_single: bool,
    /// Sizes along the seven axes that there can be, 1 where there are fewer.
    pub(super) sides: [u64; 7],
    pub(super) datatype: i16,
    pub(super) bitpix: i16,
    pub(super) pixdim: [f64; 8],
    /// Where the voxels begin in their file.
    pub(super) voxel_offset: u64,
    pub(super) slope: f64,
    pub(super) intercept: f64,
    pub(super) units: i32,
    pub(super) qform_code: i32,
    pub(super) sform_code: i32,
    /// The parts b, c and d of a unit quaternion.
    pub(super) quaternion: DVec3,
    pub(super) offset: DVec3,
    pub(super) srow: [[f64; 4]; 3],
}

const BYTES_1: usize = 348;
const BYTES_2: usize = 540;

impl Header {
    pub(super) fn read(file: &mut Source) -> Result<Self, VolumeFault> {
        let head = file.take(BYTES_1 as u64)?;
        let length = [head[0], head[1], head[2], head[3]];
        for (order, length) in
            [(ByteOrder::Little, i32::from_le_bytes(length)), (ByteOrder::Big, i32::from_be_bytes(length))]
        {
            match length as usize {
                BYTES_1 => return Self::of_version_1(&head, order),
                BYTES_2 => {
                    let tail = file.take((BYTES_2 - BYTES_1) as u64)?;
                    return Self::of_version_2(&[&*head, &*tail].concat(), order);
                }
                _ => {}
            }
        }
        let reason = format!("{}, but a NIfTI file begins with 348 or 540", i32::from_le_bytes(length));
        Err(malformed("sizeof_hdr", reason))
    }

    /// The crate reads nothing but this header for us: its volumes reserve the memory that a header claims.
    fn of_version_1(bytes: &[u8], order: ByteOrder) -> Result<Self, VolumeFault> {
        let magic = &bytes[BYTES_1 - 4..];
        let is_single = match magic {
            b"n+1\0" => true,
            b"ni1\0" => false,
            _ => return Err(wrong_magic(magic)),
        };
        // It takes the byte order from the number of axes, which is where a damaged file misleads it.
        let axes = i16_at(bytes, 40, order);
        if !(1..=7).contains(&axes) {
            return Err(malformed("dim[0]", format!("{axes} is not a number of axes from 1 to 7")));
        }
        let header = NiftiHeader::from_reader(bytes).map_err(|error| malformed("header", error.to_string()))?;
        let expected = if order == ByteOrder::Little { Endianness::Little } else { Endianness::Big };
        if header.endianness != expected {
            return Err(malformed("dim[0]", "its byte order is another than that of sizeof_hdr"));
        }
        // A size is signed in the file.
        let dim = header.dim.map(|size| i64::from(size as i16));
        let offset = f64::from(header.vox_offset);
        if !(offset.fract() == 0.0 && offset.abs() <= 1e9) {
            return Err(malformed("vox_offset", format!("{offset:?} is no place in the file")));
        }
        Ok(Self {
            format: VolumeFormat::Nifti1,
            bytes: BYTES_1 as u64,
            order,
            is_single,
            sides: sides(dim)?,
            datatype: header.datatype,
            bitpix: header.bitpix,
            pixdim: header.pixdim.map(f64::from),
            voxel_offset: voxel_offset(offset as i64, is_single, BYTES_1 as u64)?,
            slope: header.scl_slope.into(),
            intercept: header.scl_inter.into(),
            units: header.xyzt_units.into(),
            qform_code: header.qform_code.into(),
            sform_code: header.sform_code.into(),
            quaternion: DVec3::new(header.quatern_b.into(), header.quatern_c.into(), header.quatern_d.into()),
            offset: DVec3::new(header.quatern_x.into(), header.quatern_y.into(), header.quatern_z.into()),
            srow: [header.srow_x, header.srow_y, header.srow_z].map(|row| row.map(f64::from)),
        })
    }

    /// The crate does not know this version.
    fn of_version_2(bytes: &[u8], order: ByteOrder) -> Result<Self, VolumeFault> {
        let magic = &bytes[4..8];
        let is_single = match magic {
            b"n+2\0" => true,
            b"ni2\0" => false,
            _ => return Err(wrong_magic(magic)),
        };
        // What a file loses when it is sent as text.
        if bytes[8..12] != *b"\r\n\x1a\n" {
            return Err(malformed("magic", "the line ends in it are damaged; the file was copied as text"));
        }
        let f64_at = |at: usize| f64::from_bits(i64_at(bytes, at, order) as u64);
        let i32_at = |at: usize| match order {
            ByteOrder::Little => i32::from_le_bytes(part(bytes, at)),
            ByteOrder::Big => i32::from_be_bytes(part(bytes, at)),
        };
        let dim = std::array::from_fn(|k| i64_at(bytes, 16 + 8 * k, order));
        let row = |at: usize| std::array::from_fn(|k| f64_at(at + 8 * k));
        Ok(Self {
            format: VolumeFormat::Nifti2,
            bytes: BYTES_2 as u64,
            order,
            is_single,
            sides: sides(dim)?,
            datatype: i16_at(bytes, 12, order),
            bitpix: i16_at(bytes, 14, order),
            pixdim: std::array::from_fn(|k| f64_at(104 + 8 * k)),
            voxel_offset: voxel_offset(i64_at(bytes, 168, order), is_single, BYTES_2 as u64)?,
            slope: f64_at(176),
            intercept: f64_at(184),
            qform_code: i32_at(344),
            sform_code: i32_at(348),
            quaternion: DVec3::new(f64_at(352), f64_at(360), f64_at(368)),
            offset: DVec3::new(f64_at(376), f64_at(384), f64_at(392)),
            srow: [row(400), row(432), row(464)],
            units: i32_at(500),
        })
    }
}

fn wrong_magic(magic: &[u8]) -> VolumeFault {
    let shown = magic.escape_ascii();
    malformed("magic", format!("`{shown}` is not that of NIfTI (n+1, ni1, n+2 or ni2)"))
}

fn sides(dim: [i64; 8]) -> Result<[u64; 7], VolumeFault> {
    let axes = dim[0];
    if !(1..=7).contains(&axes) {
        return Err(malformed("dim[0]", format!("{axes} is not a number of axes from 1 to 7")));
    }
    let mut sides = [1; 7];
    for (at, side) in sides.iter_mut().enumerate().take(axes as usize) {
        let size = dim[at + 1];
        *side = u64::try_from(size)
            .ok()
            .filter(|size| *size > 0)
            .ok_or_else(|| malformed(format!("dim[{}]", at + 1), format!("{size} is not a positive number")))?;
    }
    Ok(sides)
}

/// Some writers leave the offset of a single file at 0 and put the voxels behind the header and its four bytes of extensions.
fn voxel_offset(offset: i64, is_single: bool, header_bytes: u64) -> Result<u64, VolumeFault> {
    let offset =
        u64::try_from(offset).map_err(|_| malformed("vox_offset", format!("{offset} is no place in the file")))?;
    match (is_single, offset) {
        (true, 0) => Ok(header_bytes + 4),
        (true, _) if offset < header_bytes => {
            Err(malformed("vox_offset", format!("{offset} lies within the header, which has {header_bytes} bytes")))
        }
        _ => Ok(offset),
    }
}

/// Bytes at a fixed place of a header whose length was checked.
fn part<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    std::array::from_fn(|k| bytes[at + k])
}

fn i16_at(bytes: &[u8], at: usize, order: ByteOrder) -> i16 {
    match order {
        ByteOrder::Little => i16::from_le_bytes(part(bytes, at)),
        ByteOrder::Big => i16::from_be_bytes(part(bytes, at)),
    }
}

fn i64_at(bytes: &[u8], at: usize, order: ByteOrder) -> i64 {
    match order {
        ByteOrder::Little => i64::from_le_bytes(part(bytes, at)),
        ByteOrder::Big => i64::from_be_bytes(part(bytes, at)),
    }
}
