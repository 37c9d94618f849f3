//! Runs an example in a window, or headless.

use super::args::{Args, Backend};
use super::{devices, recording, report::Measures, volumes};
use bevy::asset::{AssetLoadError, LoadState, UnapprovedPathMode};
use bevy::camera::RenderTarget;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy::render::renderer::RenderAdapterInfo;
use bevy_surgery::diagnostics::SurgeryDiagnosticsPlugin;
use bevy_surgery::organ::awaited_models;
use bevy_surgery::prelude::*;
use bevy_surgery::render::graphics_adapters;
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::VolumeLoadFailed;
use clap::Parser;
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};
#[cfg(target_os = "linux")]
use std::time::Duration;
use std::time::Instant;

/// Who moves the view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(dead_code, reason = "not every example can be turned")]
pub enum Viewer {
    /// A person with a mouse.
    Person,
    /// Nobody: the example turns what it shows.
    Nobody,
    /// A recording, which was made of something that did not turn.
    Recording,
}

/// How a run is shown, for an example's `setup`.
#[derive(Resource, Clone)]
pub struct Stage {
    /// Where cameras draw to.
    pub target: RenderTarget,
    /// Who moves the view.
    #[allow(dead_code, reason = "not every example can be turned")]
    pub viewer: Viewer,
}

/// Steps that a headless run still takes, of an example whose end is not known before. What it takes is at most what it begins with.
#[derive(Resource, Clone, Copy)]
#[allow(dead_code, reason = "most examples take as many as they are told")]
pub struct StepsLeft(pub u32);

/// Names of pictures that an example draws, one per step, instead of as many frames as it was told to.
#[derive(Resource, Clone)]
#[allow(dead_code, reason = "not every example draws figures")]
pub struct Pictures(pub Vec<String>);

impl Stage {
    fn new(args: &Args, target: RenderTarget, without_recording: Viewer) -> Self {
        Self { target, viewer: if args.replay.is_some() { Viewer::Recording } else { without_recording } }
    }
}

/// Parses the arguments and runs an example: `add` adds its systems, `count` fills the report's counters.
pub fn main_with(
    name: &str,
    add: impl FnOnce(&mut App),
    count: impl FnOnce(&mut World) -> Map<String, Value>,
) -> ExitCode {
    let args = Args::parse();
    let add = |app: &mut App| {
        devices::build(app);
        add(app);
    };
    let ran = if args.device.iter().any(|id| id == "list") {
        devices::list()
    } else if args.backend == Some(Backend::Cpu) {
        run_models(&args, name, add, count)
    } else if graphics_adapters().is_empty() {
        Err("no Vulkan, Metal or DirectX driver was found: run script/bootstrap, or use --backend cpu".into())
    } else if opens_window(&args) {
        run_window(&args, name, add)
    } else {
        run_headless(&args, name, add, count)
    };
    match ran {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("{name}: {reason}");
            ExitCode::FAILURE
        }
    }
}

/// Whether a run with these arguments is shown in a window.
pub fn opens_window(args: &Args) -> bool {
    args.backend != Some(Backend::Cpu) && args.out.is_none() && args.figure.is_none() && has_display()
}

/// The organ of the arguments; otherwise a real one of the data folder beside the project, where it is there;
/// otherwise the liver that ships with the crate.
#[allow(dead_code, reason = "not every example has organs")]
pub fn organ(
    args: &Args,
    real: Option<&str>,
    options: OrganOptions,
    assets: &AssetServer,
    models: &mut Assets<OrganModel>,
) -> Result<Handle<OrganModel>> {
    let beside =
        |name| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/mesh").join(name).canonicalize().ok();
    // Bevy would look for a relative path among the crate's assets.
    let given = args.mesh.as_ref().map(std::path::absolute).transpose()?;
    let Some(file) = given.or_else(|| real.and_then(beside)) else {
        return Ok(models.add(OrganModel::procedural_liver(&options)?));
    };
    let with_options = move |settings: &mut OrganOptions| *settings = options.clone();
    Ok(assets.load_builder().with_settings(with_options).override_unapproved().load(file))
}

/// Whether a window can be opened: whether an X server answers at `DISPLAY` (`:0`, `unix:0.0` or `host:10.0`).
#[cfg(target_os = "linux")]
fn has_display() -> bool {
    use std::net::{TcpStream, ToSocketAddrs};
    use std::os::unix::net::UnixStream;
    let display = std::env::var("DISPLAY").unwrap_or_default();
    let Some((host, screen)) = display.rsplit_once(':') else { return false };
    let Ok(number) = screen.split('.').next().unwrap_or_default().parse::<u16>() else { return false };
    if matches!(host, "" | "unix") {
        // The file alone says nothing: a server that died leaves it behind.
        return UnixStream::connect(format!("/tmp/.X11-unix/X{number}")).is_ok();
    }
    let Some(port) = number.checked_add(6000) else { return false };
    let addresses = (host, port).to_socket_addrs().into_iter().flatten();
    addresses.take(4).any(|address| TcpStream::connect_timeout(&address, Duration::from_millis(500)).is_ok())
}

/// Whether a window can be opened: elsewhere there always is a desktop.
#[cfg(not(target_os = "linux"))]
fn has_display() -> bool {
    true
}

fn run_window(args: &Args, name: &str, add: impl FnOnce(&mut App)) -> Result<(), String> {
    let window = Window { title: name.into(), resolution: (args.size.x, args.size.y).into(), ..default() };
    let mut app = App::new();
    app.add_plugins((
        DefaultPlugins
            .set(WindowPlugin { primary_window: Some(window), ..default() })
            .set(AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Deny, ..default() }),
        SurgeryPlugins,
    ));
    app.insert_resource(args.clone());
    app.insert_resource(Stage::new(args, RenderTarget::default(), Viewer::Person));
    recording::build(&mut app, args, name)?;
    let keep = args.clone();
    app.add_systems(Last, move |world: &World, exits: MessageReader<AppExit>| {
        if !exits.is_empty()
            && let Err(reason) = recording::finish(world, &keep)
        {
            error!("{reason}");
        }
    });
    let escape = |keys: Res<ButtonInput<KeyCode>>, mut exit: MessageWriter<AppExit>| {
        if keys.just_pressed(KeyCode::Escape) {
            exit.write(AppExit::Success);
        }
    };
    app.add_systems(Update, escape);
    let failed: Arc<Mutex<Option<String>>> = default();
    let slot = failed.clone();
    app.add_systems(
        Update,
        move |assets: Res<AssetServer>,
              models: Res<Assets<OrganModel>>,
              organs: Query<(&Organ, Option<&OrganShape>)>,
              volumes: Query<&VolumeLoadFailed>,
              mut exit: MessageWriter<AppExit>| {
            let failed_volume = volumes.iter().next().map(|failed| failed.0.to_string());
            let failed = failed_organ(&assets, &awaited_models(&models, organs.iter())).or(failed_volume);
            if let Some(reason) = failed {
                slot.lock().unwrap_or_else(PoisonError::into_inner).replace(reason);
                exit.write(AppExit::error());
            }
        },
    );
    add(&mut app);
    let exit = app.run();
    match (failed.lock().unwrap_or_else(PoisonError::into_inner).take(), exit) {
        (Some(reason), _) => Err(reason),
        (None, AppExit::Success) => Ok(()),
        (None, AppExit::Error(code)) => Err(format!("stopped with code {code}; the log above says why")),
    }
}

fn run_headless(
    args: &Args,
    name: &str,
    add: impl FnOnce(&mut App),
    count: impl FnOnce(&mut World) -> Map<String, Value>,
) -> Result<(), String> {
    let out = folder(args, name)?;
    let mut app = TestApp::gpu_with(args.size.x, args.size.y, |app| {
        app.add_plugins((bevy::log::LogPlugin::default(), PbrPlugin::default(), RenderDiagnosticsPlugin));
    });
    app.add_plugins(SurgeryDiagnosticsPlugin);
    app.insert_resource(args.clone());
    let target = RenderTarget::Image(app.target().image.into());
    app.insert_resource(Stage::new(args, target, Viewer::Nobody));
    recording::build(&mut app, args, name)?;
    add(&mut app);
    let mut measures = Measures::default();
    wait_for_bodies(&mut app, &mut measures)?;
    app.warm_up();
    let pictures = app.world().get_resource::<Pictures>().cloned();
    let steps = pictures.as_ref().map_or(args.steps(), |pictures| pictures.0.len() as u32);
    let steps = app.world().get_resource::<StepsLeft>().map_or(steps, |steps| steps.0);
    for frame in 0..steps {
        let started = Instant::now();
        app.step(1);
        measures.take(&app, started.elapsed());
        let is_over = app.world().get_resource::<StepsLeft>().is_some_and(|steps| steps.0 == 0);
        if is_over {
            let file = out.join(format!("frame-{frame:04}.png"));
            app.capture().save(&file).map_err(|error| format!("{}: {error}", file.display()))?;
            break;
        }
        let name = match &pictures {
            Some(pictures) => pictures.0[frame as usize].clone(),
            None if frame % args.every.max(1) == 0 || frame + 1 == steps => format!("frame-{frame:04}"),
            None => continue,
        };
        let file = out.join(format!("{name}.png"));
        app.capture().save(&file).map_err(|error| format!("{}: {error}", file.display()))?;
    }
    compare_with_empty(&mut app, &mut measures);
    volumes::compare_with_empty(&mut app, &mut measures);
    let adapter = app.world().resource::<RenderAdapterInfo>().name.clone();
    recording::finish(app.world(), args)?;
    let counters = count(app.world_mut());
    write_report(&out, measures.report(&adapter, args.size, counters))
}

fn run_models(
    args: &Args,
    name: &str,
    add: impl FnOnce(&mut App),
    count: impl FnOnce(&mut World) -> Map<String, Value>,
) -> Result<(), String> {
    let out = folder(args, name)?;
    let mut app = TestApp::cpu();
    app.add_plugins((bevy::log::LogPlugin::default(), SurgeryDiagnosticsPlugin));
    app.insert_resource(args.clone());
    app.insert_resource(Stage::new(args, RenderTarget::default(), Viewer::Nobody));
    recording::build(&mut app, args, name)?;
    add(&mut app);
    let mut measures = Measures::default();
    wait_for_bodies(&mut app, &mut measures)?;
    let steps = app.world().get_resource::<StepsLeft>().map_or(args.steps(), |steps| steps.0);
    for _ in 0..steps {
        let started = Instant::now();
        app.step(1);
        measures.take(&app, started.elapsed());
        if app.world().get_resource::<StepsLeft>().is_some_and(|steps| steps.0 == 0) {
            break;
        }
    }
    recording::finish(app.world(), args)?;
    let counters = count(app.world_mut());
    write_report(&out, measures.report("none", args.size, counters))
}

/// Why an organ's file could not be used, if one could not.
fn failed_organ(assets: &AssetServer, organs: &[Handle<OrganModel>]) -> Option<String> {
    organs.iter().find_map(|organ| match assets.load_state(organ) {
        LoadState::Failed(error) => {
            // Bevy wraps what the loader says in the file's name and the loader's type.
            let text = match &*error {
                AssetLoadError::AssetLoaderError(error) => error.error().to_string(),
                other => other.to_string(),
            };
            // The first line: with RUST_BACKTRACE set, more follow.
            text.lines().next().map(ToString::to_string)
        }
        _ => None,
    })
}

/// Waits until every organ has its shape and every volume is there, and notes how long that took.
fn wait_for_bodies(app: &mut TestApp, measures: &mut Measures) -> Result<(), String> {
    let started = Instant::now();
    let mut failed = None;
    let mut failed_volumes = app.world_mut().query::<&VolumeLoadFailed>();
    app.idle_until("organs and volumes", |app| {
        let is_volume_waiting = volumes::is_waiting(app.world_mut());
        let mut organs = app.world_mut().query::<(&Organ, Option<&OrganShape>)>();
        let world = app.world();
        let waiting = awaited_models(world.resource::<Assets<OrganModel>>(), organs.iter(world));
        failed = failed_organ(world.resource::<AssetServer>(), &waiting)
            .or_else(|| volumes::failed_volume(&mut failed_volumes, world));
        waiting.is_empty() && !is_volume_waiting || failed.is_some()
    });
    measures.organs_ready = started.elapsed();
    failed.map_or(Ok(()), Err)
}

/// Draws frames without organs, with the first one alone and with all of them in turn, so that all see the same noise
/// of the machine.
fn compare_with_empty(app: &mut TestApp, measures: &mut Measures) {
    let mut organs: Vec<Entity> = app.world_mut().query_filtered::<Entity, With<Organ>>().iter(app.world()).collect();
    organs.sort();
    if organs.is_empty() {
        return;
    }
    for round in 0..3 * 25 {
        let shown = [0, 1, organs.len()][round % 3];
        for (place, &organ) in organs.iter().enumerate() {
            let visibility = if place < shown { Visibility::Inherited } else { Visibility::Hidden };
            app.world_mut().entity_mut(organ).insert(visibility);
        }
        let started = Instant::now();
        app.idle();
        measures.by_organs_shown[round % 3].push(started.elapsed().as_secs_f64() * 1e3);
    }
}

fn folder(args: &Args, name: &str) -> Result<PathBuf, String> {
    let out = args.out.clone().unwrap_or_else(|| Path::new("out").join(name));
    std::fs::create_dir_all(&out).map_err(|error| format!("{}: {error}", out.display()))?;
    Ok(out)
}

fn write_report(out: &Path, report: Value) -> Result<(), String> {
    let file = out.join("report.json");
    let text = format!("{report:#}\n");
    std::fs::write(&file, text).map_err(|error| format!("{}: {error}", file.display()))?;
    println!("{}", file.display());
    Ok(())
}
