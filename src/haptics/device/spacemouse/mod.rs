//! 3Dconnexion's SpaceMouse over USB: six directions and no force.
//!
//! A cap that springs back cannot say where a handle is, so it says how fast the handle moves ([`RateControl`]). A thread for
//! each device takes its reports in.

mod rate;
mod report;
mod transport;

use super::link::{Link, Linked};
use super::{
    DeviceBackend, DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice,
};
use super::{device_clock_s, serial};
pub use rate::{RateControl, RateHandle};
pub use report::{SpaceMouseModel, SpaceMouseReport, parse_report};
use std::sync::Arc;
use std::time::{Duration, Instant};
pub use transport::{HidTransport, ReportSource, ReportTransport};

/// Reports come at most this often; without any the handle still moves on.
const PERIOD: Duration = Duration::from_millis(2);

/// SpaceMice on this machine.
pub struct SpaceMouseBackend<T: ReportTransport = HidTransport> {
    control: RateControl,
    transport: T,
}

impl Default for SpaceMouseBackend {
    fn default() -> Self {
        Self::new(RateControl::default(), HidTransport::default())
    }
}

impl<T: ReportTransport> SpaceMouseBackend<T> {
    /// SpaceMice that are reached in some way and move handles as told.
    pub fn new(control: RateControl, transport: T) -> Self {
        Self { control, transport }
    }

    fn found(&mut self) -> Result<Vec<(String, SpaceMouseModel)>, DeviceFault> {
        self.transport.list().map_err(|reason| DeviceFault::Service {
            service: "the system's list of input devices".into(),
            address: "USB".into(),
            reason,
        })
    }
}

fn info(serial: &str, model: SpaceMouseModel, control: RateControl) -> DeviceInfo {
    DeviceInfo {
        id: format!("spacemouse:{serial}"),
        name: model.name().into(),
        kind: DeviceKind::SpaceMouse,
        limits: DeviceLimits { workspace_radius_m: control.reach_m, ..DeviceLimits::NO_FORCE },
        has_force: false,
        has_rotation: true,
        has_grip: false,
        buttons: model.buttons(),
    }
}

impl<T: ReportTransport> DeviceBackend for SpaceMouseBackend<T> {
    fn name(&self) -> &'static str {
        "spacemouse"
    }

    fn list(&mut self) -> Result<Vec<DeviceInfo>, DeviceFault> {
        let control = self.control;
        Ok(self.found()?.into_iter().map(|(serial, model)| info(&serial, model, control)).collect())
    }

    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        let wanted = serial(id, "spacemouse");
        let found = self.found()?;
        let Some((serial, model)) = found.iter().find(|(serial, _)| serial == wanted) else {
            let there: Vec<_> = found.iter().map(|(serial, _)| format!("spacemouse:{serial}")).collect();
            return Err(DeviceFault::NotFound { id: id.into(), there: there.join(", ") });
        };
        let info = info(serial, *model, self.control);
        let gone = |reason: String| DeviceFault::Gone { id: info.id.clone(), reason };
        let source = self.transport.open(serial).map_err(gone)?;
        let first = RateHandle::new(self.control).step(0.0, device_clock_s());
        let link = Link::new(Ok(first), Duration::ZERO);
        let (kept, name, control) = (link.clone(), info.id.clone(), self.control);
        let thread = std::thread::Builder::new().name("haptics-spacemouse".into());
        thread.spawn(move || keep(source, &kept, &name, control)).map_err(|error| gone(error.to_string()))?;
        Ok(Box::new(SpaceMouseDevice { linked: Linked::new(link, &info.id), info }))
    }
}

/// The thread of one device.
fn keep(mut source: Box<dyn ReportSource>, link: &Arc<Link>, id: &str, control: RateControl) {
    let mut handle = RateHandle::new(control);
    let mut last = Instant::now();
    let mut bytes = [0; 64];
    while !link.is_closing() {
        match source.read(&mut bytes, PERIOD) {
            Ok(length) => {
                if let Some(report) = bytes.get(..length).and_then(parse_report) {
                    handle.take(report);
                }
                let dt_s = last.elapsed().as_secs_f64();
                last = Instant::now();
                link.put(Ok(handle.step(dt_s, device_clock_s())));
            }
            Err(reason) => {
                link.put(Err(DeviceFault::Gone { id: id.into(), reason }));
                break;
            }
        }
    }
    link.set_closed();
}

/// A SpaceMouse.
struct SpaceMouseDevice {
    linked: Linked,
    info: DeviceInfo,
}

impl HapticDevice for SpaceMouseDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        self.linked.read()
    }

    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault> {
        self.linked.link.write(output, 0.0)
    }
}
