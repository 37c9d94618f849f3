//! Records the camera's path, and follows a recorded one.

use super::args::Args;
use bevy::prelude::*;
use serde_json::json;
use std::path::Path;

/// The camera's place at each step: x y z metres, then the rotation's x y z w.
#[derive(Resource, Default)]
struct Path3(Vec<[f32; 7]>);

/// Records or replays what the arguments ask for. Call it before the app runs.
pub fn build(app: &mut App, args: &Args, name: &str) -> Result<(), String> {
    // These record and open whole runs by themselves.
    if matches!(name, "training" | "designer") {
        return Ok(());
    }
    if args.replay.is_some() && args.record.is_some() {
        return Err("--record and --replay cannot be used together here".into());
    }
    if let Some(file) = &args.replay {
        app.insert_resource(Path3(read(file)?)).add_systems(FixedFirst, replay);
    } else if args.record.is_some() {
        app.init_resource::<Path3>().add_systems(FixedLast, record);
    }
    Ok(())
}

/// Writes what was recorded, if it was.
pub fn finish(world: &World, args: &Args) -> Result<(), String> {
    let (Some(file), Some(path)) = (&args.record, world.get_resource::<Path3>()) else { return Ok(()) };
    let text = json!({ "camera_path": path.0 }).to_string();
    std::fs::write(file, text).map_err(|error| format!("{}: {error}", file.display()))
}

fn read(file: &Path) -> Result<Vec<[f32; 7]>, String> {
    let fault = |reason: String| format!("{}: {reason}", file.display());
    let text = std::fs::read_to_string(file).map_err(|error| fault(error.to_string()))?;
    let value: serde_json::Value = serde_json::from_str(&text).map_err(|error| fault(error.to_string()))?;
    let path: Vec<[f32; 7]> = serde_json::from_value(value["camera_path"].clone())
        .map_err(|error| fault(format!("camera_path must be a list of seven numbers per step: {error}")))?;
    if let Some(step) = path.iter().position(|place| place.iter().any(|number| !number.is_finite())) {
        return Err(fault(format!("camera_path: step {step} holds a number that is not finite")));
    }
    // A turn is scaled to length 1, which neither nothing nor what overflows can be.
    let is_turn = |&[_, _, _, i, j, k, w]: &[f32; 7]| (1e-6..f32::INFINITY).contains(&Vec4::new(i, j, k, w).length());
    match path.iter().position(|place| !is_turn(place)) {
        Some(step) => Err(fault(format!("camera_path: the last four numbers of step {step} are no rotation"))),
        None => Ok(path),
    }
}

fn record(mut path: ResMut<Path3>, cameras: Query<&Transform, With<Camera3d>>) {
    if let Some(camera) = cameras.iter().next() {
        let (at, turn) = (camera.translation, camera.rotation);
        path.0.push([at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w]);
    }
}

fn replay(path: Res<Path3>, mut step: Local<usize>, mut cameras: Query<&mut Transform, With<Camera3d>>) {
    let Some(&[x, y, z, i, j, k, w]) = path.0.get(*step) else { return };
    *step += 1;
    for mut camera in &mut cameras {
        camera.translation = Vec3::new(x, y, z);
        camera.rotation = Quat::from_xyzw(i, j, k, w).normalize();
    }
}
