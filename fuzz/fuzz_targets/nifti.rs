//! NIfTI, packed and not; the header of a pair has its voxels behind its own bytes.

#![no_main]

use bevy_surgery::volume::load::{VolumeLoadOptions, parse_with};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for frame in [None, Some(1)] {
        let options = VolumeLoadOptions { frame, ..VolumeLoadOptions::default() };
        let _ = parse_with(bytes, "a.hdr", &options, &mut |_| Ok(bytes.to_vec()));
    }
});
