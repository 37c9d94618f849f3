//! The panel beside the round picture: the drill, what was removed, and what is near.

use crate::Patient;
use crate::common::{Args, Backend, Stage, add_interface};
use crate::drill::{Danger, Drill, WARNING_MM};
use crate::irrigate::{self, OtherHand};
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{ClearColorConfig, Viewport};
use bevy::prelude::*;
use bevy::text::FontSize;
use bevy_surgery::pool::{PoolState, WaterBudget};
use bevy_surgery::prelude::*;
use bevy_surgery::volume::cut::BurrShape;
use bevy_surgery::volume::structures::Structure;
use bevy_surgery::volume::{CtVolume, RemovedTissue, Volume};

/// What the last key did.
#[derive(Resource, Default)]
pub struct Notice(pub String);

/// Most structures that are listed.
const ROWS: usize = 20;
/// Least and greatest width of the panel, pixels.
const WIDTHS_PX: [u32; 2] = [200, 320];
/// Height of the panel over a pair of pictures, as a share of the frame's.
const STEREO_SHARE: f32 = 0.16;
const PLAIN: Color = Color::srgb(0.82, 0.86, 0.86);
const WARNING: Color = Color::srgb(1.0, 0.72, 0.1);
const ALARM: Color = Color::srgb(1.0, 0.22, 0.16);

/// The camera of the panel's part of the frame.
#[derive(Component)]
struct PanelCamera;

/// A line of the panel by its place.
#[derive(Component, Clone, Copy, PartialEq)]
enum Line {
    Drill,
    Fluid,
    Nearest,
    Structure(usize),
    Notice,
}

/// The patch of a structure's colour in a line.
#[derive(Component)]
struct Chip(usize);

pub fn build(app: &mut App) {
    app.init_resource::<Notice>();
    if app.world().resource::<Args>().backend == Some(Backend::Cpu) {
        return;
    }
    add_interface(app);
    app.add_systems(Startup, spawn_panel).add_systems(Update, (lay_out, write_lines));
}

fn spawn_panel(mut commands: Commands, stage: Res<Stage>) {
    let camera = Camera {
        order: 10,
        clear_color: ClearColorConfig::Custom(Color::srgb(0.02, 0.025, 0.03)),
        is_active: false,
        ..default()
    };
    let camera =
        commands.spawn((PanelCamera, Camera2d, camera, Msaa::Off, RenderLayers::none(), stage.target.clone())).id();
    let line = |line| {
        let font = TextFont { font_size: FontSize::Px(11.0), ..default() };
        (line, Text::default(), font, TextColor(PLAIN))
    };
    commands
        .spawn((
            UiTargetCamera(camera),
            Node {
                width: percent(100),
                height: percent(100),
                flex_direction: FlexDirection::Column,
                flex_wrap: FlexWrap::Wrap,
                padding: UiRect::all(px(8)),
                row_gap: px(3),
                column_gap: px(12),
                ..default()
            },
        ))
        .with_children(|panel| {
            panel.spawn(line(Line::Drill));
            panel.spawn(line(Line::Fluid));
            panel.spawn(line(Line::Nearest));
            for row in 0..ROWS {
                panel.spawn(Node { column_gap: px(6), align_items: AlignItems::Center, ..default() }).with_children(
                    |pair| {
                        pair.spawn((
                            Chip(row),
                            Node { width: px(9), height: px(9), flex_shrink: 0.0, ..default() },
                            BackgroundColor(Color::NONE),
                        ));
                        pair.spawn(line(Line::Structure(row)));
                    },
                );
            }
            panel.spawn(line(Line::Notice));
        });
}

/// Gives the panel a strip of the frame and the microscope the rest; a pair of pictures takes the whole frame itself, and the
/// panel what is left over them.
fn lay_out(
    mut microscopes: Query<(&mut Camera, Has<StereoPair>), (With<Microscope>, Without<PanelCamera>)>,
    mut panels: Query<&mut Camera, With<PanelCamera>>,
) {
    let (Some((mut scope, is_pair)), Some(mut panel)) = (microscopes.iter_mut().next(), panels.iter_mut().next())
    else {
        return;
    };
    let Some(size) = panel.physical_target_size().filter(|size| size.min_element() > 0) else { return };
    let part = |corner: UVec2, size: UVec2| {
        Some(Viewport { physical_position: corner, physical_size: size.max(UVec2::ONE), ..default() })
    };
    let (strip, rest) = if is_pair {
        (part(UVec2::ZERO, UVec2::new(size.x, (STEREO_SHARE * size.y as f32) as u32)), None)
    } else {
        let width = size.x.saturating_sub(size.y).clamp(WIDTHS_PX[0], WIDTHS_PX[1]).min(size.x / 2);
        let rest = UVec2::new(size.x - width, size.y);
        (part(UVec2::ZERO, UVec2::new(width, size.y)), part(UVec2::new(width, 0), rest))
    };
    let extent = |camera: &Camera| camera.viewport.as_ref().map(|part| (part.physical_position, part.physical_size));
    for (camera, part) in [(&mut scope, rest), (&mut panel, strip)] {
        if extent(camera) != part.as_ref().map(|part| (part.physical_position, part.physical_size)) {
            camera.viewport = part;
        }
    }
    if !panel.is_active {
        panel.is_active = true;
    }
}

fn write_lines(
    drill: Res<Drill>,
    danger: Res<Danger>,
    notice: Res<Notice>,
    hand: Option<Res<OtherHand>>,
    pools: Query<(&PoolState, &WaterBudget)>,
    volumes: Res<Assets<Volume>>,
    patients: Query<(&CtVolume, &RemovedTissue), With<Patient>>,
    mut lines: Query<(&Line, &mut Text, &mut TextColor)>,
    mut chips: Query<(&Chip, &mut BackgroundColor)>,
) {
    let patient =
        patients.iter().next().and_then(|(source, removed)| Some((volumes.get(&source.0)?.structures()?, removed)));
    let list = patient.map_or(&[][..], |(structures, _)| structures.list());
    let rows: Vec<(&Structure, f64)> = patient.map_or(Vec::new(), |(_, removed)| listed(list, removed));
    let is_hurt = danger.alarm_steps > 0 || danger.nearest.is_some_and(|(_, mm)| mm <= 0.0);
    let is_near = danger.nearest.is_some_and(|(_, mm)| mm < WARNING_MM);
    let colour = if is_hurt {
        ALARM
    } else if is_near {
        WARNING
    } else {
        PLAIN
    };
    for (line, mut text, mut text_colour) in &mut lines {
        let (said, colour) = match *line {
            Line::Drill => (said_of_drill(&drill), PLAIN),
            Line::Fluid => {
                let pool = pools.iter().next().zip(hand.as_ref());
                (pool.map_or_else(String::new, |((state, water), hand)| irrigate::said(hand, state, water)), PLAIN)
            }
            Line::Nearest => {
                let named =
                    danger.nearest.and_then(|(label, mm)| Some((list.get(usize::from(label).checked_sub(1)?)?, mm)));
                let said = match named {
                    Some((structure, mm)) if mm > 0.0 => format!("{}\n{mm:.1} mm away\n", structure.name),
                    Some((structure, _)) => format!("{}\nTOUCHED\n", structure.name),
                    None if is_hurt => "HURT\n\n".into(),
                    None => "nothing critical near\n\n".into(),
                };
                (said, colour)
            }
            Line::Structure(row) => match rows.get(row) {
                Some((structure, mm3)) if *mm3 > 0.0 => {
                    let colour = if structure.is_critical { ALARM } else { PLAIN };
                    let lost = if *mm3 < 0.05 { "a trace".into() } else { format!("{mm3:.1} mm3") };
                    (format!("{}\n{lost}", structure.name), colour)
                }
                Some((structure, _)) => (structure.name.clone(), PLAIN),
                None => (String::new(), PLAIN),
            },
            Line::Notice => (notice.0.clone(), PLAIN),
        };
        if text.0 != said {
            text.0 = said;
        }
        text_colour.set_if_neq(TextColor(colour));
    }
    for (chip, mut colour) in &mut chips {
        let shown = rows.get(chip.0).map_or(Color::NONE, |(structure, _)| {
            let [red, green, blue] = structure.colour;
            Color::srgb_u8(red, green, blue)
        });
        colour.set_if_neq(BackgroundColor(shown));
    }
}

fn said_of_drill(drill: &Drill) -> String {
    let shape = match drill.burr.shape {
        BurrShape::Sphere => "ball",
        BurrShape::Cylinder { .. } => "cylinder",
        BurrShape::Matchstick { .. } => "matchstick",
    };
    let (kind, mm) = (format!("{:?}", drill.burr.kind), drill.burr.diameter_m * 1e3);
    let is_on = if drill.is_on && drill.pose.is_some() { "drilling" } else { "off" };
    format!("{kind} {shape} {mm:.0} mm\n{:.2} N  {:.0}000/min\n{is_on}\n", drill.force_n, drill.speed_rpm / 1e3)
}

/// What lost something, most first, then what must not.
fn listed<'a>(list: &'a [Structure], removed: &RemovedTissue) -> Vec<(&'a Structure, f64)> {
    let mut rows: Vec<(&Structure, f64)> =
        list.iter().zip(1..=255).map(|(structure, label)| (structure, removed.of_label_mm3(label))).collect();
    rows.retain(|(structure, mm3)| *mm3 > 0.0 || structure.is_critical);
    rows.sort_by(|a, b| b.1.total_cmp(&a.1));
    rows.truncate(ROWS);
    rows
}
