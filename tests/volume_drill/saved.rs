//! Cuts as files.

use super::phantom::{PLENTY_N, Phantom, all_of, ball, resting, upright};
use bevy_surgery::volume::cut::{CutError, CutVolume};
use glam::{DVec3, UVec3};
use proptest::prelude::*;
use std::sync::LazyLock;

const HASH: [u8; 32] = [5; 32];
/// Where the checksum lies.
const CHECKSUM: std::ops::Range<usize> = 56..88;

/// A cut and its file.
static SAVED: LazyLock<(CutVolume, Vec<u8>)> = LazyLock::new(|| {
    let phantom = Phantom::block(64);
    let mut cut = phantom.cut();
    phantom.follow(&mut cut, ball(4.0), 30.0, 60, 1.0, |t| DVec3::new(-9.0 + 18.0 * t, 9.0, 3.0 * (7.0 * t).sin()));
    let bytes = cut.save(HASH);
    (cut, bytes)
});

/// What a file with a right checksum says.
fn signed(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&bytes[..CHECKSUM.start]).update(&bytes[CHECKSUM.end..]);
    bytes[CHECKSUM].copy_from_slice(hasher.finalize().as_bytes());
    bytes
}

#[test]
fn what_is_saved_comes_back_bit_by_bit() {
    let (cut, bytes) = &*SAVED;
    let loaded = CutVolume::load(bytes, cut.size(), HASH).expect("just saved");
    assert!(&loaded == cut);
    let bits = |cut: &CutVolume| all_of(cut).into_iter().map(f32::to_bits).collect::<Vec<_>>();
    assert!(bits(&loaded) == bits(cut));
    assert_eq!(&loaded.save(HASH), bytes);
    let stored = bits(cut).iter().filter(|&&bits| bits != 1f32.to_bits()).count();
    println!("{stored} voxels differ from 1: {} bytes", bytes.len());
    assert!(bytes.len() < stored * 4, "{} bytes for {stored} voxels", bytes.len());
    let untouched = CutVolume::new(UVec3::new(300, 17, 1));
    let loaded = CutVolume::load(&untouched.save(HASH), untouched.size(), HASH).expect("nothing is something");
    assert!(loaded == untouched && !loaded.can_undo());
}

#[test]
fn a_loaded_cut_is_news_to_readers_of_another() {
    let (cut, bytes) = &*SAVED;
    let loaded = CutVolume::load(bytes, cut.size(), HASH).expect("just saved");
    assert_eq!(loaded.changes_since(cut.revision()), None);
    assert_eq!(loaded.changes_since(0), None);
}

#[test]
fn another_volumes_cut_is_refused() {
    let (cut, bytes) = &*SAVED;
    let error = CutVolume::load(bytes, cut.size(), [6; 32]).expect_err("another hash");
    assert!(matches!(error, CutError::OtherVolume { .. }), "{error}");
    let error = CutVolume::load(bytes, UVec3::new(64, 64, 65), HASH).expect_err("another size");
    assert!(error.to_string().contains("another volume"), "{error}");
    // The real hash changes with a single voxel.
    let phantom = Phantom::block(64);
    let other = Phantom::new(*phantom.grid(), |voxel| (u8::from(voxel == UVec3::splat(9)), 1));
    let mut cut = phantom.cut();
    phantom.drill(&mut cut, &resting(ball(4.0), upright(DVec3::ZERO), PLENTY_N), 1.0);
    let bytes = cut.save(phantom.volume.content_hash());
    assert!(CutVolume::load(&bytes, cut.size(), phantom.volume.content_hash()).is_ok());
    assert!(CutVolume::load(&bytes, cut.size(), other.volume.content_hash()).is_err());
}

#[test]
fn broken_files_say_what_is_wrong() {
    let (cut, bytes) = &*SAVED;
    let load = |bytes: &[u8]| CutVolume::load(bytes, cut.size(), HASH).expect_err("broken");
    assert_eq!(load(b""), CutError::NotACut);
    assert_eq!(load(b"\x89PNG\r\n\x1a\n and more"), CutError::NotACut);
    let mut newer = bytes.clone();
    newer[7] = 2;
    assert_eq!(load(&newer), CutError::Version(2));
    for length in [7, 8, 40, 87, 88, 100, bytes.len() - 1] {
        assert!(matches!(load(&bytes[..length]), CutError::Damaged(_)), "{length} bytes");
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert!(matches!(load(&longer), CutError::Damaged(_)));
    // With a right checksum: fewer and more bricks than it says, no deflated data.
    let mut count = bytes.clone();
    count[52] -= 1;
    assert!(load(&signed(count.clone())).to_string().contains("follows"));
    count[52..56].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(load(&signed(count)).to_string().contains("end early"));
    assert!(load(&signed(bytes[..200].to_vec())).to_string().contains("end early"));
}

#[test]
fn numbers_that_no_cut_has_are_refused() {
    let (cut, bytes) = &*SAVED;
    let mut inflated = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::DeflateDecoder::new(&bytes[88..]), &mut inflated).expect("deflated");
    let load = |inflated: &[u8]| {
        let mut deflated = flate2::write::DeflateEncoder::new(bytes[..88].to_vec(), flate2::Compression::fast());
        std::io::Write::write_all(&mut deflated, inflated).expect("memory");
        CutVolume::load(&signed(deflated.finish().expect("memory")), cut.size(), HASH)
    };
    assert!(load(&inflated).is_ok_and(|loaded| &loaded == cut));
    // The highest bytes of the first brick's numbers: 1.0 becomes 2.0 or more, or negative, or not a number.
    for value in [0x40, 0xbf, 0x7f] {
        let mut wrong = inflated.clone();
        wrong[4 + 3 * 4096] = value;
        assert!(matches!(load(&wrong), Err(CutError::Damaged(_))), "{value:x}");
    }
    for place in [u32::MAX, 64, 0] {
        let mut wrong = inflated.clone();
        wrong[16388..16392].copy_from_slice(&place.to_le_bytes());
        assert!(load(&wrong).is_err_and(|error| error.to_string().contains("out of place")), "{place}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_files_never_panic(
        places in prop::collection::vec((0usize..1 << 20, any::<u8>()), 1..8),
        cut_to in prop::option::of(0usize..1 << 16),
        is_signed in any::<bool>(),
    ) {
        let (cut, bytes) = &*SAVED;
        let mut mutated = bytes.clone();
        for (place, value) in places {
            let place = place % mutated.len();
            mutated[place] = value;
        }
        if let Some(length) = cut_to {
            mutated.truncate(length);
        }
        if is_signed && mutated.len() >= CHECKSUM.end {
            mutated = signed(mutated);
        }
        match CutVolume::load(&mutated, cut.size(), HASH) {
            Ok(loaded) => {
                prop_assert!(is_signed || &mutated == bytes, "a damaged file was taken");
                prop_assert!(all_of(&loaded).into_iter().all(|remaining| (0.0..=1.0).contains(&remaining)));
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}
