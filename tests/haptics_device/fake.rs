//! Libraries that take the place of a maker's: compiled by the test that needs them, one copy of their own for each.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

/// A copy of a library, with its own state, and its functions for tests.
pub struct Fake {
    pub path: PathBuf,
    _folder: tempfile::TempDir,
    set: unsafe extern "C" fn(u32, f64),
    get: unsafe extern "C" fn(u32) -> f64,
}

impl Fake {
    /// The fixture, set up with these values.
    pub fn new(fixture: &str, values: &[(u32, f64)]) -> Self {
        let (folder, path) = copy(fixture, &[]);
        // SAFETY: our own library, which is never unloaded; its functions are as declared.
        let (set, get) = unsafe {
            let library = Box::leak(Box::new(libloading::Library::new(&path).expect("it loads")));
            (*library.get(b"fake_set\0").expect("there"), *library.get(b"fake_get\0").expect("there"))
        };
        let fake = Self { path, _folder: folder, set, get };
        values.iter().for_each(|(key, value)| fake.set(*key, *value));
        fake
    }

    pub fn set(&self, key: u32, value: f64) {
        // SAFETY: as declared in the fixture.
        unsafe { (self.set)(key, value) };
    }

    pub fn get(&self, key: u32) -> f64 {
        // SAFETY: as declared in the fixture.
        unsafe { (self.get)(key) }
    }

    /// The force that a device was told last.
    pub fn force(&self, device: u32) -> [f64; 3] {
        std::array::from_fn(|axis| self.get(40 + 3 * device + axis as u32))
    }
}

/// A fixture as a library file of one's own; compiled once for each set of `--cfg`.
pub fn copy(fixture: &str, cfgs: &[&str]) -> (tempfile::TempDir, PathBuf) {
    type Built = BTreeMap<String, (tempfile::TempDir, PathBuf)>;
    static BUILT: Mutex<Built> = Mutex::new(Built::new());
    let mut built = BUILT.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let (_, library) = built.entry(format!("{fixture} {cfgs:?}")).or_insert_with(|| compile(fixture, cfgs));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(library.file_name().expect("a name"));
    std::fs::copy(library, &path).expect("a copy");
    (folder, path)
}

fn compile(fixture: &str, cfgs: &[&str]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(format!("{fixture}.rs"));
    let library =
        folder.path().join(format!("{}{fixture}{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX));
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let mut command = Command::new(rustc);
    command.args(["--edition", "2024", "--crate-type", "cdylib", "--check-cfg", "cfg(incomplete,old)", "-o"]);
    command.arg(&library).arg(source);
    for cfg in cfgs {
        command.args(["--cfg", *cfg]);
    }
    let output = command.output().expect("a compiler");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (folder, library)
}
