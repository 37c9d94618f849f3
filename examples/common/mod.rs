//! What all examples share: their arguments, the window or the headless run, and `report.json`.

mod args;
#[allow(dead_code, reason = "not every example has instruments")]
pub mod devices;
#[allow(dead_code, reason = "not every example writes on the screen")]
mod interface;
mod recording;
mod report;
mod run;
#[allow(dead_code, reason = "not every example shows a volume")]
mod volumes;

#[allow(unused_imports, reason = "not every example uses every part")]
pub use args::{Args, Backend, Script};
#[allow(unused_imports, reason = "not every example uses every part")]
pub use devices::hold_device;
#[allow(unused_imports, reason = "not every example uses every part")]
pub use interface::add_interface;
#[allow(unused_imports, reason = "not every example uses every part")]
pub use run::{Pictures, Stage, StepsLeft, Viewer, main_with, opens_window, organ};
#[allow(unused_imports, reason = "not every example uses every part")]
pub use volumes::{Chosen, volume};
