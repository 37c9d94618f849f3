//! PNG and JPEG pictures as a stack of two slices.

#![no_main]

use bevy_surgery::volume::load::{VolumeLoadOptions, parse_folder};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for extension in ["png", "jpg"] {
        let files = [1, 2].map(|number| (format!("{number}.{extension}"), bytes.to_vec()));
        let _ = parse_folder(files.to_vec(), "stack", &VolumeLoadOptions::default());
    }
});
