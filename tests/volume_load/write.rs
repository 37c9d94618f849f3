//! Writes small files of every format, as other programs would.

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use std::io::Write;

/// A type of number, as each format calls it, with twelve numbers of it and the type that they are kept in.
pub struct Kind {
    pub name: &'static str,
    pub nrrd: &'static [&'static str],
    pub met: &'static [&'static str],
    pub nifti: i16,
    pub values: [f64; 12],
    pub kept: &'static str,
}

pub fn kinds() -> Vec<Kind> {
    let kind = |name, nrrd, met, nifti, extremes: [f64; 2], kept| {
        let mut values: [f64; 12] = std::array::from_fn(|at| at as f64);
        [values[4], values[11]] = extremes;
        Kind { name, nrrd, met, nifti, values, kept }
    };
    vec![
        kind("u8", &["uchar", "unsigned char", "uint8", "uint8_t"], &["MET_UCHAR"], 2, [255.0, 128.0], "u8"),
        kind("i8", &["signed char", "int8", "int8_t"], &["MET_CHAR"], 256, [-128.0, 127.0], "i16"),
        kind(
            "i16",
            &["short", "short int", "signed short", "signed short int", "int16", "int16_t"],
            &["MET_SHORT"],
            4,
            [-32768.0, 32767.0],
            "i16",
        ),
        kind(
            "u16",
            &["ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"],
            &["MET_USHORT"],
            512,
            [65535.0, 258.0],
            "u16",
        ),
        kind("i32", &["int", "signed int", "int32", "int32_t"], &["MET_INT", "MET_LONG"], 8, [-1024.0, 3071.0], "i16"),
        kind("i32", &["int"], &["MET_INT"], 8, [-70_000.0, 65_536.0], "f32"),
        kind(
            "u32",
            &["uint", "unsigned int", "uint32", "uint32_t"],
            &["MET_UINT", "MET_ULONG"],
            768,
            [40_000.0, 0.0],
            "u16",
        ),
        kind("u32", &["uint"], &["MET_UINT"], 768, [4e9, 0.0], "f32"),
        kind(
            "i64",
            &["longlong", "long long", "long long int", "signed long long", "signed long long int", "int64", "int64_t"],
            &["MET_LONG_LONG"],
            1024,
            [-1_099_511_627_776.0, 1.0],
            "f32",
        ),
        kind(
            "u64",
            &["ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"],
            &["MET_ULONG_LONG"],
            1280,
            [9_223_372_036_854_775_808.0, 1.0],
            "f32",
        ),
        kind("f32", &["float"], &["MET_FLOAT"], 16, [-0.5, 1e20_f32 as f64], "f32"),
        kind("f64", &["double"], &["MET_DOUBLE"], 64, [0.25, -3.0], "f32"),
        kind("f64", &["double"], &["MET_DOUBLE"], 64, [-1024.0, 3071.0], "i16"),
    ]
}

/// Numbers of a type in a byte order.
pub fn numbers(name: &str, values: &[f64], is_big: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    for value in values {
        macro_rules! push {
            ($type:ty) => {
                bytes.extend(if is_big { (*value as $type).to_be_bytes() } else { (*value as $type).to_le_bytes() })
            };
        }
        match name {
            "u8" => push!(u8),
            "i8" => push!(i8),
            "u16" => push!(u16),
            "i16" => push!(i16),
            "u32" => push!(u32),
            "i32" => push!(i32),
            "u64" => push!(u64),
            "i64" => push!(i64),
            "f32" => push!(f32),
            "f64" => push!(f64),
            _ => panic!("no type {name}"),
        }
    }
    bytes
}

/// Numbers as text, in lines of five.
pub fn text(values: &[f64]) -> Vec<u8> {
    let lines = values.chunks(5).map(|line| line.iter().map(f64::to_string).collect::<Vec<_>>().join(" "));
    lines.collect::<Vec<_>>().join("\n").into_bytes()
}

pub fn hex(bytes: &[u8]) -> Vec<u8> {
    let lines = bytes.chunks(20).map(|line| line.iter().map(|byte| format!("{byte:02x}")).collect::<String>());
    lines.collect::<Vec<_>>().join("\n").into_bytes()
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

pub fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[cfg(feature = "dicom")]
pub fn deflate(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::DeflateEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// An NRRD of 3 x 2 x 2 with further fields.
pub fn nrrd(fields: &str, data: &[u8]) -> Vec<u8> {
    let has_dimension = fields.lines().any(|line| line.starts_with("dimension:"));
    let dimension = if has_dimension { "" } else { "dimension: 3\nsizes: 3 2 2\n" };
    [format!("NRRD0004\n# written for a test\n{dimension}{fields}\n\n").as_bytes(), data].concat()
}

/// A MetaImage of 3 x 2 x 2 with further fields; the last is the data file's.
pub fn metaimage(fields: &str, file: &str, data: &[u8]) -> Vec<u8> {
    let sizes = if fields.contains("NDims") { "" } else { "NDims = 3\nDimSize = 3 2 2\n" };
    [format!("ObjectType = Image\n{sizes}{fields}\nElementDataFile = {file}\n").as_bytes(), data].concat()
}

/// The header of a NIfTI file, of version 1 or 2.
#[derive(Clone)]
pub struct Nifti {
    pub is_version_2: bool,
    pub is_big: bool,
    pub is_single: bool,
    pub dim: [i64; 8],
    pub datatype: i16,
    pub bitpix: i16,
    pub pixdim: [f64; 8],
    pub voxel_offset: i64,
    pub slope: f64,
    pub intercept: f64,
    pub units: i32,
    pub qform_code: i32,
    pub sform_code: i32,
    pub quaternion: [f64; 3],
    pub offset: [f64; 3],
    pub srow: [[f64; 4]; 3],
}

impl Default for Nifti {
    fn default() -> Self {
        Self {
            is_version_2: false,
            is_big: false,
            is_single: true,
            dim: [3, 3, 2, 2, 1, 1, 1, 1],
            datatype: 2,
            bitpix: 8,
            pixdim: [1.0; 8],
            voxel_offset: 352,
            slope: 0.0,
            intercept: 0.0,
            units: 2,
            qform_code: 0,
            sform_code: 0,
            quaternion: [0.0; 3],
            offset: [0.0; 3],
            srow: [[0.0; 4]; 3],
        }
    }
}

impl Nifti {
    pub fn file(&self, voxels: &[u8]) -> Vec<u8> {
        let mut bytes = self.header();
        if self.is_single {
            bytes.resize((self.voxel_offset as usize).clamp(bytes.len(), 1000), 0);
            bytes.extend(voxels);
        }
        bytes
    }

    pub fn header(&self) -> Vec<u8> {
        let mut bytes = vec![0; if self.is_version_2 { 540 } else { 348 }];
        let mut put = |at: usize, name: &str, values: &[f64]| {
            let numbers = numbers(name, values, self.is_big);
            bytes[at..at + numbers.len()].copy_from_slice(&numbers);
        };
        let dim = self.dim.map(|size| size as f64);
        if self.is_version_2 {
            put(0, "i32", &[540.0]);
            put(12, "i16", &[self.datatype.into(), self.bitpix.into()]);
            put(16, "i64", &dim);
            put(104, "f64", &self.pixdim);
            put(168, "i64", &[self.voxel_offset as f64]);
            put(176, "f64", &[self.slope, self.intercept]);
            put(344, "i32", &[self.qform_code.into(), self.sform_code.into()]);
            put(352, "f64", &[self.quaternion, self.offset].concat());
            put(400, "f64", &self.srow.concat());
            put(500, "i32", &[self.units.into()]);
            let magic = if self.is_single { b"n+2\0\r\n\x1a\n" } else { b"ni2\0\r\n\x1a\n" };
            bytes[4..12].copy_from_slice(magic);
        } else {
            put(0, "i32", &[348.0]);
            put(40, "i16", &dim);
            put(70, "i16", &[self.datatype.into(), self.bitpix.into()]);
            put(76, "f32", &self.pixdim);
            put(108, "f32", &[self.voxel_offset as f64, self.slope, self.intercept]);
            put(123, "u8", &[self.units.into()]);
            put(252, "i16", &[self.qform_code.into(), self.sform_code.into()]);
            put(256, "f32", &[self.quaternion, self.offset].concat());
            put(280, "f32", &self.srow.concat());
            bytes[344..].copy_from_slice(if self.is_single { b"n+1\0" } else { b"ni1\0" });
        }
        bytes
    }
}

/// A picture in any colour type that `image` writes.
pub fn picture(
    width: u32,
    height: u32,
    pixels: &[u8],
    colour: image::ExtendedColorType,
    format: image::ImageFormat,
) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::write_buffer_with_format(&mut bytes, pixels, width, height, colour, format).unwrap();
    bytes.into_inner()
}

/// One DICOM file.
#[cfg(feature = "dicom")]
#[derive(Clone)]
pub struct Dicom {
    pub transfer_syntax: &'static str,
    pub series: &'static str,
    pub description: &'static str,
    pub columns: u16,
    pub rows: u16,
    pub position: Option<[f64; 3]>,
    pub orientation: Option<[f64; 6]>,
    pub pixel_spacing: Option<[f64; 2]>,
    pub bits: [u16; 3],
    pub is_signed: bool,
    pub photometric: &'static str,
    pub slope_intercept: Option<[f64; 2]>,
    /// Further elements, written before the pixels.
    pub extra: Vec<(u16, u16, &'static str, Vec<u8>)>,
    /// Whether pixels are written as fragments.
    pub is_encapsulated: bool,
}

#[cfg(feature = "dicom")]
impl Default for Dicom {
    fn default() -> Self {
        Self {
            transfer_syntax: "1.2.840.10008.1.2.1",
            series: "1.2.3",
            description: "for a test",
            columns: 3,
            rows: 2,
            position: Some([0.0; 3]),
            orientation: Some([1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
            pixel_spacing: Some([0.5, 0.25]),
            bits: [16, 12, 11],
            is_signed: false,
            photometric: "MONOCHROME2",
            slope_intercept: Some([1.0, -1024.0]),
            extra: Vec::new(),
            is_encapsulated: false,
        }
    }
}

#[cfg(feature = "dicom")]
impl Dicom {
    pub fn file(&self, pixels: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0; 128];
        bytes.extend(b"DICM");
        let uid = Element { is_big: false, is_explicit: true };
        uid.put(&mut bytes, 2, 0x10, "UI", self.transfer_syntax.as_bytes());
        let data_set = self.data_set(pixels);
        match self.transfer_syntax.ends_with(".99") {
            true => bytes.extend(deflate(&data_set)),
            false => bytes.extend(data_set),
        }
        bytes
    }

    fn data_set(&self, pixels: &[u8]) -> Vec<u8> {
        let is_big = self.transfer_syntax == "1.2.840.10008.1.2.2";
        let element = Element { is_big, is_explicit: self.transfer_syntax != "1.2.840.10008.1.2" };
        let short = |number: u16| if is_big { number.to_be_bytes() } else { number.to_le_bytes() }.to_vec();
        let decimals = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join("\\").into_bytes();
        let mut elements: Vec<(u16, u16, &str, Vec<u8>)> = vec![
            (0x0008, 0x103e, "LO", self.description.into()),
            (0x0020, 0x000e, "UI", self.series.into()),
            (0x0028, 0x0002, "US", short(1)),
            (0x0028, 0x0004, "CS", self.photometric.into()),
            (0x0028, 0x0010, "US", short(self.rows)),
            (0x0028, 0x0011, "US", short(self.columns)),
            (0x0028, 0x0100, "US", short(self.bits[0])),
            (0x0028, 0x0101, "US", short(self.bits[1])),
            (0x0028, 0x0102, "US", short(self.bits[2])),
            (0x0028, 0x0103, "US", short(self.is_signed.into())),
        ];
        let mut put = |group, number, vr, numbers: Option<&[f64]>| {
            elements.extend(numbers.map(|numbers| (group, number, vr, decimals(numbers))));
        };
        put(0x0020, 0x0032, "DS", self.position.as_ref().map(|n| &n[..]));
        put(0x0020, 0x0037, "DS", self.orientation.as_ref().map(|n| &n[..]));
        put(0x0028, 0x0030, "DS", self.pixel_spacing.as_ref().map(|n| &n[..]));
        put(0x0028, 0x1053, "DS", self.slope_intercept.as_ref().map(|n| &n[..1]));
        put(0x0028, 0x1052, "DS", self.slope_intercept.as_ref().map(|n| &n[1..]));
        for (group, number, vr, value) in &self.extra {
            elements.retain(|element| (element.0, element.1) != (*group, *number));
            elements.push((*group, *number, vr, value.clone()));
        }
        elements.sort_by_key(|element| (element.0, element.1));
        let mut bytes = Vec::new();
        for (group, number, vr, value) in elements {
            element.put(&mut bytes, group, number, vr, &value);
        }
        if self.is_encapsulated {
            element.tag(&mut bytes, 0x7fe0, 0x0010);
            bytes.extend(b"OB\0\0\xff\xff\xff\xff");
            for item in [&[], pixels] {
                element.tag(&mut bytes, 0xfffe, 0xe000);
                bytes.extend((item.len() as u32).next_multiple_of(2).to_le_bytes());
                bytes.extend(item);
                bytes.resize(bytes.len().next_multiple_of(2), 0);
            }
            element.tag(&mut bytes, 0xfffe, 0xe0dd);
            bytes.extend([0; 4]);
        } else if !pixels.is_empty() {
            element.put(&mut bytes, 0x7fe0, 0x0010, "OW", pixels);
        }
        bytes
    }
}

#[cfg(feature = "dicom")]
struct Element {
    is_big: bool,
    is_explicit: bool,
}

#[cfg(feature = "dicom")]
impl Element {
    fn tag(&self, bytes: &mut Vec<u8>, group: u16, number: u16) {
        for half in [group, number] {
            bytes.extend(if self.is_big { half.to_be_bytes() } else { half.to_le_bytes() });
        }
    }

    fn put(&self, bytes: &mut Vec<u8>, group: u16, number: u16, vr: &str, value: &[u8]) {
        self.tag(bytes, group, number);
        let length = (value.len() as u32).next_multiple_of(2);
        let long = if self.is_big { length.to_be_bytes() } else { length.to_le_bytes() };
        match (self.is_explicit, vr) {
            (false, _) => bytes.extend(long),
            (true, "OB" | "OW" | "SQ" | "UN") => {
                bytes.extend(vr.as_bytes());
                bytes.extend([0, 0]);
                bytes.extend(long);
            }
            (true, _) => {
                bytes.extend(vr.as_bytes());
                let length = length as u16;
                bytes.extend(if self.is_big { length.to_be_bytes() } else { length.to_le_bytes() });
            }
        }
        bytes.extend(value);
        if value.len() % 2 == 1 {
            bytes.push(if vr == "UI" || vr == "OB" || vr == "OW" { 0 } else { b' ' });
        }
    }
}
