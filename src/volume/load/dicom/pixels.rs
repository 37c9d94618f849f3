//! The pixels of a slice as numbers.

use super::file::{Pixels, Slice};
use super::guard::Expected;
use crate::files::excerpt;
use crate::volume::error::VolumeFault;
use crate::volume::load::{malformed, unsupported};
use dicom_core::{DataElement, PrimitiveValue, Tag, VR, value::PixelFragmentSequence};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use dicom_pixeldata::PixelDecoder;
use std::borrow::Cow;

/// Whole numbers of any kind that DICOM has: those of up to 16 bits fit without sign as well as with it.
pub(super) fn decode(slice: &Slice) -> Result<Vec<i32>, VolumeFault> {
    let bytes = bytes(slice)?;
    let stored = u32::from(slice.bits_stored);
    // Overlays may hide in the bits above, and below where the highest bit is not the last of those stored.
    let (left, right) = (31 - u32::from(slice.high_bit), 32 - stored);
    let sample = |word: u32| match slice.is_signed {
        true => (word << left).cast_signed() >> right,
        false => ((word << left) >> right).cast_signed(),
    };
    let swapped = slice.is_big_endian;
    let mut samples: Vec<i32> = match slice.bits_allocated {
        8 => bytes.iter().map(|byte| sample((*byte).into())).collect(),
        16 => {
            let word = if swapped { u16::from_be_bytes } else { u16::from_le_bytes };
            bytes.as_chunks().0.iter().map(|chunk| sample(word(*chunk).into())).collect()
        }
        _ => {
            let word = if swapped { u32::from_be_bytes } else { u32::from_le_bytes };
            bytes.as_chunks().0.iter().map(|chunk| sample(word(*chunk))).collect()
        }
    };
    if slice.photometric == "MONOCHROME1" {
        // The least is white: turned round within what the bits can say.
        let turned = if slice.is_signed { -1 } else { ((1_i64 << stored) - 1) as i32 };
        samples.iter_mut().for_each(|sample| *sample = turned.wrapping_sub(*sample));
    }
    Ok(samples)
}

/// Refuses what is no slice of numbers, before anything is unpacked.
pub(super) fn check(slice: &Slice) -> Result<(), VolumeFault> {
    if slice.frames > 1 {
        return Err(unsupported(
            format!("a file with {} frames", slice.frames),
            "split it into files of one frame each, or convert it to NIfTI or NRRD",
        ));
    }
    if slice.samples != 1 || !matches!(&*slice.photometric, "MONOCHROME1" | "MONOCHROME2" | "") {
        return Err(unsupported(
            format!("PhotometricInterpretation {}", excerpt(&slice.photometric)),
            "save it in grey, or as a folder of PNG pictures",
        ));
    }
    if !matches!(slice.bits_allocated, 8 | 16 | 32) {
        return Err(unsupported(
            format!("BitsAllocated {}", slice.bits_allocated),
            "save it with 8, 16 or 32 bits per pixel",
        ));
    }
    if !(1..=slice.bits_allocated).contains(&slice.bits_stored) {
        let reason = format!("{} of {} allocated bits cannot be stored", slice.bits_stored, slice.bits_allocated);
        return Err(malformed("BitsStored", reason));
    }
    if !(slice.bits_stored..=slice.bits_allocated).contains(&(slice.high_bit.saturating_add(1))) {
        let reason = format!("{} is not the last of {} stored bits", slice.high_bit, slice.bits_stored);
        return Err(malformed("HighBit", reason));
    }
    if !(slice.slope.is_finite() && slice.slope != 0.0) {
        return Err(malformed("RescaleSlope", format!("values of {:?} * stored mean nothing", slice.slope)));
    }
    Ok(())
}

fn bytes<'a>(slice: &Slice<'a>) -> Result<Cow<'a, [u8]>, VolumeFault> {
    let expected = u64::from(slice.rows) * u64::from(slice.columns) * u64::from(slice.bits_allocated / 8);
    let bytes = match &slice.pixels {
        Pixels::None => return Err(malformed("PixelData", "this field is missing")),
        Pixels::Native(bytes) => Cow::Borrowed(*bytes),
        Pixels::Fragments(fragments) => Cow::Owned(unpack(slice, fragments)?),
    };
    let found = bytes.len() as u64;
    if found < expected {
        return Err(VolumeFault::Truncated { what: "PixelData".into(), expected, found });
    }
    // Values have an even number of bytes.
    if found > expected.next_multiple_of(2) {
        return Err(VolumeFault::Oversized { what: "PixelData".into(), expected });
    }
    let expected = expected as usize;
    Ok(match bytes {
        Cow::Borrowed(bytes) => Cow::Borrowed(&bytes[..expected]),
        Cow::Owned(mut bytes) => {
            bytes.truncate(expected);
            Cow::Owned(bytes)
        }
    })
}

fn unpack(slice: &Slice, fragments: &[&[u8]]) -> Result<Vec<u8>, VolumeFault> {
    let data: Cow<[u8]> = match fragments {
        [] => return Err(malformed("PixelData", "there is not one fragment in it")),
        [one] => Cow::Borrowed(*one),
        // One picture in several pieces.
        several => Cow::Owned(several.concat()),
    };
    let expected =
        Expected { columns: slice.columns.into(), rows: slice.rows.into(), bits_allocated: slice.bits_allocated };
    let uid = &*slice.transfer_syntax;
    match uid.strip_prefix("1.2.840.10008.1.2.") {
        Some("1.98") => return Ok(data.into_owned()),
        Some("5") => expected.check_runs(&data)?,
        Some("4.50" | "4.51" | "4.57" | "4.70") => expected.check_jpeg(&data)?,
        Some("4.90" | "4.91" | "4.92" | "4.93" | "4.201" | "4.202" | "4.203") => expected.check_jpeg_2000(&data)?,
        _ => {
            return Err(unsupported(
                format!("transfer syntax {}", excerpt(uid)),
                "unpack it to Explicit VR Little Endian, with `gdcmconv --raw` or `dcmdjpls`",
            ));
        }
    }
    if slice.bits_allocated > 16 {
        return Err(unsupported(
            "packed pixels of 32 bits",
            "unpack it to Explicit VR Little Endian, with `gdcmconv --raw`",
        ));
    }
    let broken = |reason: &str| malformed("PixelData", format!("its packed pixels are damaged ({})", excerpt(reason)));
    // What the guards let through can still be damaged within: dicom-transfer-syntax-registry indexes and slices by numbers
    // that it decodes, jpeg-decoder and openjp2 (a port of C) have assertions and unwraps of their own.
    let decoded = std::panic::catch_unwind(|| {
        let object = object(slice, data.into_owned())?;
        let decoded = object.decode_pixel_data_frame(0).map_err(|error| broken(&error_chain(&error)))?;
        Ok(decoded.into_data())
    });
    decoded.unwrap_or_else(|_| Err(broken("the decoder gave up")))
}

/// The few attributes that decoders ask for, as the object that they take.
fn object(slice: &Slice, data: Vec<u8>) -> Result<dicom_object::FileDicomObject<InMemDicomObject>, VolumeFault> {
    let mut object = InMemDicomObject::new_empty();
    for (tag, value) in [
        (0x0002, 1),
        (0x0010, slice.rows),
        (0x0011, slice.columns),
        (0x0100, slice.bits_allocated),
        (0x0101, slice.bits_stored),
        (0x0102, slice.high_bit),
        (0x0103, slice.is_signed.into()),
    ] {
        object.put_element(DataElement::new(Tag(0x0028, tag), VR::US, PrimitiveValue::from(value)));
    }
    object.put_element(DataElement::new(Tag(0x0028, 0x0004), VR::CS, PrimitiveValue::from("MONOCHROME2")));
    let pixels = PixelFragmentSequence::new_fragments(vec![data]);
    object.put_element(DataElement::new(Tag(0x7fe0, 0x0010), VR::OB, pixels));
    let meta = FileMetaTableBuilder::new()
        .transfer_syntax(&*slice.transfer_syntax)
        // Secondary capture, and any instance: decoders ask for neither.
        .media_storage_sop_class_uid("1.2.840.10008.5.1.4.1.1.7")
        .media_storage_sop_instance_uid("2.25.1")
        .build()
        .map_err(|error| malformed("TransferSyntaxUID", excerpt(&error.to_string())))?;
    Ok(object.with_exact_meta(meta))
}

/// The messages of an error and its causes; the outermost alone says only that something failed.
fn error_chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(": ");
        text.push_str(&error.to_string());
        cause = error.source();
    }
    text
}
