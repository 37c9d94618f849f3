//! One DICOM file of any transfer syntax.

#![no_main]

use bevy_surgery::volume::load::{VolumeLoadOptions, parse_with};
use libfuzzer_sys::fuzz_target;

fuzz_target!(
    // The loader catches panics of the decoders beneath it; the fuzzer's own hook would end the run at them. What is not caught
    // still ends it.
    init: std::panic::set_hook(Box::new(|_| {})),
    |bytes: &[u8]| {
        let _ = parse_with(bytes, "a.dcm", &VolumeLoadOptions::default(), &mut |_| Err("there is none".into()));
    }
);
