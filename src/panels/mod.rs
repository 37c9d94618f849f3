//! Panels for designers.

pub mod fields;
mod history;

pub use history::*;
