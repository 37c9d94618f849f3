//! Bytes of voxels, packed or not, that are read only as far as the header's size needs.

use super::malformed;
use crate::files::excerpt;
use crate::volume::error::VolumeFault;
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use std::borrow::Cow;
use std::io::{ErrorKind, Read};

/// Most bytes that come out of one byte of deflate, rounded up: what a packed file can hold at all.
const MOST_PER_BYTE: u64 = 1100;
/// More than comes out of a byte of most scans.
const USUAL_PER_BYTE: u64 = 16;

/// How bytes are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    None,
    Gzip,
    Zlib,
}

/// A run of bytes that is read from front to back.
pub(super) struct Source<'a, 'w> {
    reader: Reader<'a>,
    /// No more than this can still come out.
    most: u64,
    /// What is read, for messages.
    what: &'w str,
}

enum Reader<'a> {
    Plain(&'a [u8]),
    Packed { reader: Box<dyn Read + 'a>, name: &'static str, length: u64 },
}

impl<'a, 'w> Source<'a, 'w> {
    pub(super) fn new(bytes: &'a [u8], packing: Packing, what: &'w str) -> Self {
        let length = bytes.len() as u64;
        let packed = length * MOST_PER_BYTE;
        match packing {
            Packing::None => Self { reader: Reader::Plain(bytes), most: length, what },
            Packing::Gzip => {
                // Several members one after another are one file: block-compressed NIfTI is written so.
                let reader = Box::new(MultiGzDecoder::new(bytes));
                Self { reader: Reader::Packed { reader, name: "gzip", length }, most: packed, what }
            }
            Packing::Zlib => {
                let reader = Box::new(ZlibDecoder::new(bytes));
                Self { reader: Reader::Packed { reader, name: "zlib", length }, most: packed, what }
            }
        }
    }

    /// What the bytes look like: gzip has a magic number.
    pub(super) fn guess(bytes: &'a [u8], what: &'w str) -> Self {
        let packing = if bytes.starts_with(&[0x1f, 0x8b]) { Packing::Gzip } else { Packing::None };
        Self::new(bytes, packing, what)
    }

    /// The next bytes, exactly so many. Nothing is reserved for them that could not be there.
    pub(super) fn take(&mut self, count: u64) -> Result<Cow<'a, [u8]>, VolumeFault> {
        self.claim(count)?;
        match &mut self.reader {
            Reader::Plain(rest) => {
                let (taken, after) = rest.split_at(count as usize);
                *rest = after;
                Ok(Cow::Borrowed(taken))
            }
            Reader::Packed { reader, name, length } => {
                // What packs tighter than most grows as it comes.
                let mut taken = Vec::with_capacity(count.min(*length * USUAL_PER_BYTE) as usize);
                let read = reader.take(count).read_to_end(&mut taken);
                complete(read.map(|_| taken.len() as u64), count, self.what, name)?;
                Ok(Cow::Owned(taken))
            }
        }
    }

    /// The same bytes under another name in messages.
    pub(super) fn renamed(self, what: &'w str) -> Self {
        Self { what, ..self }
    }

    /// Refuses a claim that what is left can never fulfil.
    pub(super) fn expect(&self, count: u64) -> Result<(), VolumeFault> {
        match count > self.most {
            true => Err(VolumeFault::Truncated { what: self.what.into(), expected: count, found: self.most }),
            false => Ok(()),
        }
    }

    /// Goes over bytes that are not wanted.
    pub(super) fn skip(&mut self, count: u64) -> Result<(), VolumeFault> {
        self.claim(count)?;
        match &mut self.reader {
            Reader::Plain(rest) => {
                *rest = &rest[count as usize..];
                Ok(())
            }
            Reader::Packed { reader, name, .. } => {
                let skipped = std::io::copy(&mut reader.take(count), &mut std::io::sink());
                complete(skipped, count, self.what, name)
            }
        }
    }

    /// Makes sure that nothing follows; `expected` is what there was to be in all, for the message.
    pub(super) fn end(self, expected: u64) -> Result<(), VolumeFault> {
        let oversized = Err(VolumeFault::Oversized { what: self.what.into(), expected });
        match self.reader {
            Reader::Plain([]) => Ok(()),
            Reader::Plain(_) => oversized,
            // Also where the checksum stands.
            Reader::Packed { mut reader, name, .. } => match reader.read(&mut [0]) {
                Ok(0) => Ok(()),
                Ok(_) => oversized,
                Err(error) => Err(corrupt(self.what, name, &error)),
            },
        }
    }

    fn claim(&mut self, count: u64) -> Result<(), VolumeFault> {
        self.expect(count)?;
        self.most -= count;
        Ok(())
    }
}

fn complete(read: std::io::Result<u64>, expected: u64, what: &str, name: &str) -> Result<(), VolumeFault> {
    match read {
        Ok(found) if found < expected => Err(VolumeFault::Truncated { what: what.into(), expected, found }),
        Ok(_) => Ok(()),
        Err(error) => Err(corrupt(what, name, &error)),
    }
}

fn corrupt(what: &str, name: &str, error: &std::io::Error) -> VolumeFault {
    let reason = match error.kind() {
        ErrorKind::UnexpectedEof => format!("the {name} data end too early; the file is cut off"),
        _ => format!("the {name} data are damaged ({})", excerpt(&error.to_string())),
    };
    malformed(what, reason)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::GzEncoder;
    use std::io::Write;

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn a_bomb_is_read_no_further_than_it_is_wanted() {
        let bomb = gzip(&vec![0; 50_000_000]);
        let mut source = Source::guess(&bomb, "voxels");
        assert_eq!(source.take(1000).unwrap().len(), 1000);
        assert_eq!(source.end(1000), Err(VolumeFault::Oversized { what: "voxels".into(), expected: 1000 }));
        // A claim that no file of this size can hold is refused before a byte is reserved.
        let found = bomb.len() as u64 * MOST_PER_BYTE;
        let refused = Source::guess(&bomb, "voxels").take(1 << 40).unwrap_err();
        assert_eq!(refused, VolumeFault::Truncated { what: "voxels".into(), expected: 1 << 40, found });
        assert!(found > 50_000_000, "the densest packing there is stays within the bound");
    }

    #[test]
    fn members_follow_one_another() {
        let mut two = gzip(b"first ");
        two.extend(gzip(b"second"));
        let mut source = Source::guess(&two, "voxels");
        source.skip(3).unwrap();
        assert_eq!(&*source.take(9).unwrap(), b"st second");
        source.end(12).unwrap();
    }

    #[test]
    fn cut_off_and_damaged_data_are_told_apart() {
        let whole = gzip(b"a few bytes of voxels");
        for end in 1..whole.len() {
            let mut source = Source::new(&whole[..end], Packing::Gzip, "voxels");
            let fault = source.take(21).and_then(|_| source.end(21)).unwrap_err();
            assert!(
                matches!(fault, VolumeFault::Truncated { .. })
                    || fault.to_string() == "voxels: the gzip data end too early; the file is cut off",
                "{end}: {fault}"
            );
        }
        let mut damaged = whole.clone();
        let checksum = damaged.len() - 8;
        damaged[checksum] ^= 1;
        let mut source = Source::guess(&damaged, "voxels");
        source.take(21).unwrap();
        let fault = source.end(21).unwrap_err().to_string();
        assert!(fault.starts_with("voxels: the gzip data are damaged"), "{fault}");
    }
}
