//! Files that were changed at random: a volume that is as it should be or an error that can be read, never a panic, and never
//! more memory than the bytes that are there can account for.

use super::memory::peak;
use super::write::{Nifti, gzip, hex, metaimage, nrrd, numbers, picture, text, zlib};
use super::{load_beside, readable};
use crate::support::real_file;
use bevy_surgery::volume::Voxels;
use bevy_surgery::volume::error::VolumeError;
use bevy_surgery::volume::load::{VolumeLoadOptions, parse_folder};
use proptest::prelude::*;
use proptest::sample::Index;
use std::sync::{LazyLock, Once};

/// A file, or the first of several that belong together; a name with a slash at its end is a folder.
#[derive(Clone)]
struct Seed {
    name: &'static str,
    files: Vec<(String, Vec<u8>)>,
    /// Packed after it was changed: damage within, where a checksum would else give it away.
    is_packed: bool,
}

fn seed(name: &'static str, bytes: Vec<u8>, siblings: &[(&str, &[u8])]) -> Seed {
    let mut files = vec![(name.to_string(), bytes)];
    files.extend(siblings.iter().map(|(name, bytes)| (name.to_string(), bytes.to_vec())));
    Seed { name, files, is_packed: false }
}

fn packed(name: &'static str, bytes: Vec<u8>) -> Seed {
    Seed { is_packed: true, ..seed(name, bytes, &[]) }
}

/// A small file of every format and encoding.
static SMALL: LazyLock<Vec<Seed>> = LazyLock::new(|| {
    let values: [f64; 12] = std::array::from_fn(|at| at as f64 * 100.0 - 300.0);
    let [shorts, floats, doubles] = ["i16", "f32", "f64"].map(|name| numbers(name, &values, false));
    let bytes: Vec<u8> = (0..48).collect();
    let placed = "space: RAS\nspace directions: (1,0,0) (0,0.5,0) (0,0,2)\nspace origin: (1,2,3)";
    let spaced = format!("type: short\nendian: little\n{placed}\nencoding:");
    let mut seeds = vec![
        seed("a.nrrd", nrrd(&format!("{spaced} raw"), &shorts), &[]),
        seed("a.nrrd", nrrd(&format!("{spaced} gzip"), &gzip(&shorts)), &[]),
        seed("a.nrrd", nrrd(&format!("{spaced} hex\nbyte skip: 0"), &hex(&shorts)), &[]),
        seed("a.nrrd", nrrd("type: double\nspacings: 1 2 3\nencoding: text", &text(&values)), &[]),
        seed("a.nrrd", nrrd("type: uchar\ndimension: 4\nsizes: 4 3 2 2\nencoding: raw", &bytes), &[]),
        seed("a.nhdr", nrrd("type: uchar\nencoding: raw\nbyte skip: -1\ndata file: a.raw", &[]), &[("a.raw", &bytes)]),
        seed(
            "a.nhdr",
            nrrd("type: uchar\nencoding: raw\ndata file: s%d 1 2 1", &[]),
            &[("s1", &bytes[..6]), ("s2", &bytes[..6])],
        ),
        seed(
            "a.mha",
            metaimage("ElementType = MET_SHORT\nElementSpacing = 1 2 3\nOffset = 1 2 3", "LOCAL", &shorts),
            &[],
        ),
        seed("a.mha", metaimage("ElementType = MET_DOUBLE\nCompressedData = True", "LOCAL", &zlib(&doubles)), &[]),
        seed("a.mha", metaimage("ElementType = MET_FLOAT\nBinaryData = False", "LOCAL", &text(&values)), &[]),
        seed(
            "a.mhd",
            metaimage("ElementType = MET_UCHAR\nHeaderSize = -1\nRotation = 1 0 0 0 1 0 0 0 1", "a.raw", &[]),
            &[("a.raw", &bytes)],
        ),
        seed(
            "a.mhd",
            metaimage("ElementType = MET_UCHAR", "LIST\ns1\ns2", &[]),
            &[("s1", &bytes[..6]), ("s2", &bytes[..6])],
        ),
    ];
    let placed = Nifti { datatype: 16, bitpix: 32, sform_code: 1, slope: 2.0, ..Nifti::default() };
    let placed = Nifti { srow: [[1.0, 0.0, 0.0, 5.0], [0.0, 2.0, 0.0, 6.0], [0.0, 0.0, 3.0, 7.0]], ..placed };
    let turned = Nifti { datatype: 16, bitpix: 32, qform_code: 1, quaternion: [0.0, 0.6, 0.0], ..Nifti::default() };
    let second = Nifti { is_version_2: true, voxel_offset: 544, ..placed.clone() };
    let big = Nifti { is_big: true, ..placed.clone() };
    let pair = Nifti { is_single: false, voxel_offset: 0, ..turned.clone() };
    seeds.extend([
        seed("a.nii", placed.file(&floats), &[]),
        seed("a.nii", turned.file(&floats), &[]),
        seed("a.nii", second.file(&floats), &[]),
        seed("a.nii", big.file(&numbers("f32", &values, true)), &[]),
        seed("a.nii.gz", gzip(&placed.file(&floats)), &[]),
        packed("a.nii.gz", second.file(&floats)),
        packed("a.nii.gz", turned.file(&floats)),
        seed("a.hdr", pair.file(&[]), &[("a.img", &floats)]),
    ]);
    let grey = |format| picture(8, 2, &bytes[..16], image::ExtendedColorType::L8, format);
    for format in [image::ImageFormat::Png, image::ImageFormat::Jpeg] {
        let extension = if format == image::ImageFormat::Png { "png" } else { "jpg" };
        let files = (1..4).map(|at| (format!("slice{at}.{extension}"), grey(format))).collect();
        seeds.push(Seed { name: "stack/", files, is_packed: false });
    }
    #[cfg(feature = "dicom")]
    seeds.extend(dicom(&shorts[..12]));
    seeds
});

#[cfg(feature = "dicom")]
fn dicom(pixels: &[u8]) -> Vec<Seed> {
    use super::write::Dicom;
    let slice = |z: f64| Dicom { position: Some([1.0, 2.0, z]), ..Dicom::default() };
    let of = |transfer_syntax| Dicom { transfer_syntax, ..slice(0.0) };
    let encapsulated = |transfer_syntax| Dicom { is_encapsulated: true, ..of(transfer_syntax) };
    let mut runs = vec![0; 64];
    (runs[0], runs[4], runs[8]) = (2, 64, 66);
    runs.extend([0xfb, 1, 5, 0, 1, 2, 3, 4, 5, 0x80]);
    let jpeg = picture(3, 2, &pixels[..6], image::ExtendedColorType::L8, image::ImageFormat::Jpeg);
    let sequence = b"\xfe\xff\0\xe0\x0a\0\0\0\x08\0\x05\0CS\x02\0a \xfe\xff\0\xe0\0\0\0\0".to_vec();
    let nested = Dicom { extra: vec![(0x0008, 0x1140, "SQ", sequence)], ..slice(0.0) };
    let files = (0..3).map(|at| (format!("s{at}"), slice(at.into()).file(pixels))).collect();
    vec![
        seed("a.dcm", of("1.2.840.10008.1.2").file(pixels), &[]),
        seed("a.dcm", nested.file(pixels), &[]),
        seed("a.dcm", of("1.2.840.10008.1.2.2").file(pixels), &[]),
        seed("a.dcm", of("1.2.840.10008.1.2.1.99").file(pixels), &[]),
        seed("a.dcm", encapsulated("1.2.840.10008.1.2.5").file(&runs), &[]),
        seed("a.dcm", Dicom { bits: [8, 8, 7], ..encapsulated("1.2.840.10008.1.2.4.50") }.file(&jpeg), &[]),
        Seed { name: "series/", files, is_packed: false },
    ]
}

/// Real files that are read within milliseconds.
static REAL: LazyLock<Vec<Seed>> = LazyLock::new(|| {
    let read = |name: &str| std::fs::read(real_file(name)?).ok();
    let unpacked = |name: &str| {
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&*read(name)?), &mut bytes).ok()?;
        Some(bytes)
    };
    let folder = |path: &str, count: usize| {
        let mut names: Vec<String> = std::fs::read_dir(real_file(path)?)
            .ok()?
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .collect();
        names.sort_by_key(|name| name.chars().filter(char::is_ascii_digit).collect::<String>().parse::<u64>().ok());
        names.truncate(count);
        names.into_iter().map(|name| Some((name.clone(), read(&format!("{path}/{name}"))?))).collect::<Option<Vec<_>>>()
    };
    let one = |name, bytes: Option<Vec<u8>>| Some(seed(name, bytes?, &[]));
    let with = |name, path, beside, data| Some(seed(name, read(path)?, &[(beside, &read(data)?)]));
    let slices = |name, files: Option<_>| Some(Seed { name, files: files?, is_packed: false });
    let mut seeds = vec![
        one("breast-mr.nrrd", read("ct/breast-mr.nrrd")),
        with("tooth.nhdr", "ct/tooth.nhdr", "tooth.raw", "ct/tooth.raw"),
        with("pelvis_f.mhd", "ct/pelvis_f.mhd", "pelvis_f.raw", "ct/pelvis_f.raw"),
        one("labels.nii.gz", read("ct/abdomen-small-labels.nii.gz")),
        one("small.nii.gz", read("ct/abdomen-small.nii.gz")),
        unpacked("ct/abdomen-small-labels.nii.gz").map(|bytes| packed("labels.nii.gz", bytes)),
        slices("temporal-bone-png/", folder("ct/temporal-bone-png", 4)),
    ];
    if cfg!(feature = "dicom") {
        seeds.push(one("CT_small.dcm", read("ct/CT_small.dcm")));
        seeds.push(slices("head-dicom/", folder("ct/head-dicom", 4)));
    }
    seeds.into_iter().flatten().collect()
});

/// Words that break a reader that trusts them.
const NASTY: [&str; 8] = ["../../x", "%99d", "LIST", "\n", "\n\n", "(", "none", ":"];

/// Numbers that do, in the place of others.
const NUMBERS: [&str; 16] = [
    "-1",
    "0",
    "1",
    "2",
    "4",
    "3000",
    "0.5",
    "nan",
    "inf",
    "1e999",
    "-0.0",
    "1e-320",
    "65536",
    "4294967296",
    "18446744073709551615",
    "99999999999999999999",
];

/// A place, a value, what is done there, and whether it is done near the beginning, where headers are.
type Edit = (Index, u8, u8, bool);

/// Few at a time, and more of those that leave the rest of a header readable: what is refused early tests little.
fn edits() -> impl Strategy<Value = Vec<Edit>> {
    let kind = prop_oneof![3 => 0..3_u8, 4 => Just(3_u8), 1 => 4..8_u8];
    prop::collection::vec((any::<Index>(), any::<u8>(), kind, prop::bool::weighted(0.8)), 1..4)
}

fn change(bytes: &mut Vec<u8>, (place, value, kind, is_near): &Edit) {
    let reach = if *is_near { bytes.len().min(700) } else { bytes.len() };
    let place = place.index(reach.max(1)).min(bytes.len());
    let some = |most: u8| (place + usize::from(value % most)).min(bytes.len());
    match kind {
        0 if place < bytes.len() => bytes[place] = *value,
        1 if place < bytes.len() => bytes[place] ^= 1 << (value % 8),
        2 => {
            let end = some(5);
            bytes[place..end].fill(if value % 2 == 0 { 0xff } else { 0 });
        }
        3 => {
            // The next number that is written in digits, as a whole.
            let is_digit = |byte: &u8| byte.is_ascii_digit() || *byte == b'.';
            let start = bytes[place..].iter().position(is_digit).map_or(bytes.len(), |at| place + at);
            let end = bytes[start..].iter().position(|byte| !is_digit(byte)).map_or(bytes.len(), |at| start + at);
            drop(bytes.splice(start..end, NUMBERS[usize::from(*value) % NUMBERS.len()].bytes()));
        }
        4 => bytes.insert(place, *value),
        5 => drop(bytes.drain(place..some(16))),
        6 => bytes.truncate(place),
        _ => drop(bytes.splice(place..some(6), NASTY[usize::from(*value) % NASTY.len()].bytes())),
    }
}

/// Reads a changed file and holds what comes of it against what may, beside `fixed` bytes for tables of decoders.
fn check(seed: &Seed, edits: &[Edit], frame: Option<u32>, fixed: usize) -> Result<(), VolumeError> {
    let mut files = seed.files.clone();
    for edit in edits {
        // The first file has the header; of a folder any slice is hit.
        let at = if seed.is_folder() { edit.0.index(files.len()) } else { 0 };
        change(&mut files[at].1, edit);
    }
    if seed.is_packed {
        files[0].1 = gzip(&files[0].1);
    }
    // A decoder's panic is caught; the backtrace that would be printed of it takes more memory than what is measured.
    static QUIET: Once = Once::new();
    QUIET.call_once(|| std::panic::set_hook(Box::new(|panic| eprintln!("{panic}"))));
    let options = VolumeLoadOptions { frame, ..VolumeLoadOptions::default() };
    let input: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    let (read, most) = peak(|| match seed.is_folder() {
        true => parse_folder(files, seed.name, &options),
        false => {
            let siblings: Vec<_> = files[1..].iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
            load_beside(&files[0].1, seed.name, &siblings, &options)
        }
    });
    // Far below what a few digits more in a header ask for. A picture is unpacked into one piece, which deflate bounds.
    let per_byte = if seed.is_stack() { 2 * 1100 } else { 64 };
    assert!(most <= per_byte * input + fixed, "{}: {most} bytes for {input}", seed.name);
    let (volume, report) = read.inspect_err(|error| drop(readable(error)))?;
    let voxels = volume.voxels();
    assert_eq!(voxels.count(), volume.grid().count());
    assert!(volume.range().iter().all(|value| value.is_finite()), "{:?}", volume.range());
    assert!(volume.grid().lps_mm_from_voxel.is_finite() && volume.grid().voxel_mm3() > 0.0);
    assert!(report.voxels_replaced < voxels.count() as u64);
    if let Voxels::F32(voxels) = voxels {
        assert!(voxels.iter().all(|voxel| voxel.is_finite()));
    }
    Ok(())
}

impl Seed {
    fn is_folder(&self) -> bool {
        self.name.ends_with('/')
    }

    fn is_stack(&self) -> bool {
        self.is_folder() && self.files[0].0.contains('.') && !self.files[0].0.ends_with(".dcm")
    }
}

#[test]
fn seeds_are_whole() {
    for seed in SMALL.iter().chain(REAL.iter()) {
        check(seed, &[], None, 1 << 20).unwrap_or_else(|error| panic!("{error}"));
    }
}

/// So many cases, or what `PROPTEST_CASES` says for a longer run.
fn cases(usual: u32) -> ProptestConfig {
    let cases = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(usual);
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(cases(60_000))]

    #[test]
    fn changed_small_files_never_panic(which in any::<Index>(), edits in edits(), frame in prop::option::weighted(0.2, 0..3_u32)) {
        let _ = check(&SMALL[which.index(SMALL.len())], &edits, frame, 1 << 20);
    }
}

proptest! {
    #![proptest_config(cases(600))]

    #[test]
    fn changed_real_files_never_panic(which in any::<Index>(), edits in edits()) {
        if !REAL.is_empty() {
            let _ = check(&REAL[which.index(REAL.len())], &edits, None, 8 << 20);
        }
    }
}

#[cfg(feature = "dicom")]
proptest! {
    #![proptest_config(cases(60))]

    /// JPEG 2000, whose decoder is a port of C.
    #[test]
    fn changed_packed_slices_never_panic(edits in edits()) {
        static SLICE: LazyLock<Option<Seed>> = LazyLock::new(|| {
            let path = std::fs::read_dir(real_file("ct/abdomen-dicom")?).ok()?.next()?.ok()?.path();
            Some(seed("slice.dcm", std::fs::read(path).ok()?, &[]))
        });
        if let Some(slice) = &*SLICE {
            let _ = check(slice, &edits, None, 64 << 20);
        }
    }
}
