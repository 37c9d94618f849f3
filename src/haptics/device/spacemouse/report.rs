//! What a SpaceMouse sends over USB.

use bevy::reflect::Reflect;
use glam::DVec3;

/// 3Dconnexion devices that are known, by their USB ids.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect)]
pub enum SpaceMouseModel {
    /// SpaceNavigator, 046d:c626.
    Navigator,
    /// SpaceExplorer, 046d:c627.
    Explorer,
    /// SpaceMouse Compact, 256f:c635.
    Compact,
    /// SpaceMouse Pro Wireless, 256f:c632.
    ProWireless,
    /// SpaceMouse Enterprise, 256f:c633.
    Enterprise,
    /// Another SpaceMouse with the usual reports, 256f:c641.
    Other,
}

impl SpaceMouseModel {
    /// The model with a vendor's and a product's number.
    pub fn of(vendor: u16, product: u16) -> Option<Self> {
        Some(match (vendor, product) {
            (0x046d, 0xc626) => Self::Navigator,
            (0x046d, 0xc627) => Self::Explorer,
            (0x256f, 0xc635) => Self::Compact,
            (0x256f, 0xc632) => Self::ProWireless,
            (0x256f, 0xc633) => Self::Enterprise,
            (0x256f, 0xc641) => Self::Other,
            _ => return None,
        })
    }

    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Navigator => "3Dconnexion SpaceNavigator",
            Self::Explorer => "3Dconnexion SpaceExplorer",
            Self::Compact => "3Dconnexion SpaceMouse Compact",
            Self::ProWireless => "3Dconnexion SpaceMouse Pro Wireless",
            Self::Enterprise => "3Dconnexion SpaceMouse Enterprise",
            Self::Other => "3Dconnexion SpaceMouse",
        }
    }

    /// How many buttons it has.
    pub fn buttons(self) -> u32 {
        match self {
            Self::Navigator | Self::Compact | Self::Other => 2,
            Self::Explorer | Self::ProWireless => 15,
            Self::Enterprise => 31,
        }
    }
}

/// One report.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub enum SpaceMouseReport {
    /// The cap is pushed; shares of full deflection along the device's axes of this crate.
    Push(DVec3),
    /// The cap is turned; shares of full deflection about these axes.
    Turn(DVec3),
    /// Both, as newer devices tell.
    PushAndTurn(DVec3, DVec3),
    /// Buttons that are held, button `n` is bit `n`.
    Buttons(u32),
}

/// Full deflection in the device's numbers.
const FULL: f64 = 350.0;

/// Reads a report: its number, then little-endian numbers of 16 bits. What is too short or not known gives nothing.
///
/// The first report has X to the right, Y towards the person, Z down; the second the turns about these axes. Devices with all
/// six in the first report send twelve bytes in it.
pub fn parse_report(bytes: &[u8]) -> Option<SpaceMouseReport> {
    let (&number, data) = bytes.split_first()?;
    match (number, data.len()) {
        (1, 12..) => Some(SpaceMouseReport::PushAndTurn(push(data)?, turn(&data[6..])?)),
        (1, 6..) => Some(SpaceMouseReport::Push(push(data)?)),
        (2, 6..) => Some(SpaceMouseReport::Turn(turn(data)?)),
        (3, 1..) => {
            let byte = |place: usize| u32::from(data.get(place).copied().unwrap_or(0)) << (8 * place);
            Some(SpaceMouseReport::Buttons((0..4).map(byte).sum()))
        }
        _ => None,
    }
}

fn numbers(data: &[u8]) -> Option<[f64; 3]> {
    let (pairs, _) = data.get(..6)?.as_chunks::<2>();
    // The most negative number is one further than the most positive.
    let share = |place: usize| (f64::from(i16::from_le_bytes(pairs[place])) / FULL).clamp(-1.0, 1.0);
    Some([share(0), share(1), share(2)])
}

/// The device's Y is towards the person, which is our Z; its Z is down.
fn push(data: &[u8]) -> Option<DVec3> {
    let [x, y, z] = numbers(data)?;
    Some(DVec3::new(x, -z, y))
}

/// Pitch about X, roll about the axis towards the person, yaw about the axis down.
fn turn(data: &[u8]) -> Option<DVec3> {
    let [pitch, roll, yaw] = numbers(data)?;
    Some(DVec3::new(pitch, -yaw, roll))
}
