//! The scripted run: marks, burns, punctures, presses and a lifted edge, always the same.

use crate::instruments::{self, Held, Instrument};
use bevy::prelude::*;
use bevy_surgery::prelude::*;

/// What happens from one step to another, along a way over the picture: from its middle, in shares of half its height.
struct Act {
    steps: (u32, u32),
    instrument: Instrument,
    from: Vec2,
    to: Vec2,
}

const fn act(steps: (u32, u32), instrument: Instrument, from: (f32, f32), to: (f32, f32)) -> Act {
    Act { steps, instrument, from: Vec2::new(from.0, from.1), to: Vec2::new(to.0, to.1) }
}

/// A marking line, a burnt cross, pressure beside the reflection, and after the punctures of [`PUNCTURES`] an edge that is lifted.
const ACTS: [Act; 6] = [
    act((10, 100), Instrument::Coagulation(14.0), (-0.62, 0.10), (-0.12, 0.22)),
    act((110, 165), Instrument::Coagulation(45.0), (-0.50, -0.22), (-0.10, 0.02)),
    act((170, 225), Instrument::Coagulation(45.0), (-0.46, 0.04), (-0.14, -0.24)),
    act((226, 280), Instrument::Coagulation(45.0), (-0.14, -0.24), (-0.46, 0.04)),
    act((300, 400), Instrument::Probe, (0.16, -0.02), (0.16, -0.02)),
    act((540, 645), Instrument::Grasper, (0.40, -0.36), (0.40, -0.36)),
];

/// Steps between which the grasper rises, and how far, metres.
const LIFT: (f32, f32, f32) = (550.0, 600.0, 0.03);

/// Ten thrusts of the needle, one every six steps.
const PUNCTURES: (u32, u32) = (440, 6);

pub fn build(app: &mut App) {
    app.add_systems(FixedUpdate, perform.before(instruments::hold).in_set(SurgerySystems::Sense));
}

fn perform(
    mut held: ResMut<Held>,
    mut step: Local<u32>,
    scopes: Query<(&GlobalTransform, &Endoscope)>,
    organs: Query<(), With<ReactionModel>>,
) {
    // The clock starts when the organ is there.
    if organs.is_empty() {
        return;
    }
    let now = *step;
    *step += 1;
    held.is_on = false;
    held.ray = None;
    let Some((eye, lens)) = scopes.iter().next() else { return };
    let extent = (0.5 * lens.field_of_view_rad).tan();
    let towards = |at: Vec2| {
        let direction = eye.affine().transform_vector3(Vec3::new(at.x * extent, at.y * extent, -1.0));
        Dir3::new(direction).ok().map(|direction| Ray3d::new(eye.translation(), direction))
    };
    for act in ACTS.iter().filter(|act| (act.steps.0..act.steps.1).contains(&now)) {
        let share = (now - act.steps.0) as f32 / (act.steps.1 - act.steps.0) as f32;
        held.instrument = act.instrument;
        held.ray = towards(act.from.lerp(act.to, share));
        held.is_on = true;
        let (from, to, lift_m) = LIFT;
        held.lift_m = lift_m * ((now as f32 - from) / (to - from)).clamp(0.0, 1.0);
    }
    let (first, every) = PUNCTURES;
    if let Some(number) = now.checked_sub(first).map(|since| since / every).filter(|&number| number < 10) {
        held.instrument = Instrument::Needle;
        // Two rows over the upper slope: what comes from above runs on the wet trail of what began below, and catches it.
        let (column, row) = ((number / 2) as f32, (number % 2) as f32);
        let at = Vec2::new(0.15 * column, 0.16 + 0.16 * row - 0.04 * column);
        held.ray = towards(at);
        held.is_on = (now - first) % every < every / 2;
    }
}
