//! Transfer functions: the histogram of a volume, and points to be dragged over it.

use super::plot::Plot;
use super::{edit, edit_component};
use crate::volume::transfer::{ControlPoint, TransferFunction, ValueScale};
use crate::volume::{CtVolume, Volume};
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, poll_once};
use bevy_egui::egui::{self, Align2, Color32, Key, Sense};
use std::any::TypeId;
use std::collections::BTreeMap;

const BINS: usize = 256;
/// Voxels that are looked at for a histogram: more do not change its look.
const MOST_SAMPLES: usize = 1 << 21;
/// How near a point must be to be seized, points of the screen.
const REACH: f32 = 12.0;

/// Histograms that were made, by volume.
#[derive(Resource, Default)]
pub(super) struct Histograms {
    made: BTreeMap<AssetId<Volume>, Vec<f32>>,
    in_work: BTreeMap<AssetId<Volume>, Task<Vec<f32>>>,
}

/// Volumes that were changed or are gone are counted anew.
pub(super) fn forget_changed(mut changed: MessageReader<AssetEvent<Volume>>, mut histograms: ResMut<Histograms>) {
    for event in changed.read() {
        if let AssetEvent::Modified { id } | AssetEvent::Removed { id } | AssetEvent::Unused { id } = event {
            histograms.made.remove(id);
            histograms.in_work.remove(id);
        }
    }
}

/// Heights from 0 to 1, as cube roots: of most volumes nearly all is air.
fn histogram(volume: &Volume) -> Vec<f32> {
    let count = volume.grid().count();
    // No multiple of a row or slice, so that all of them are met.
    let stride = (count / MOST_SAMPLES).max(1) | 1;
    let mut bins = vec![0u32; BINS];
    for index in (0..count).step_by(stride) {
        let bin = (volume.normalized(index) * BINS as f32) as usize;
        bins[bin.min(BINS - 1)] += 1;
    }
    let most = bins.iter().copied().max().unwrap_or(1).max(1) as f32;
    bins.iter().map(|count| (*count as f32 / most).cbrt()).collect()
}

fn heights(world: &mut World, id: AssetId<Volume>) -> Option<Vec<f32>> {
    world.resource_scope(|world, mut histograms: Mut<Histograms>| {
        if let Some(made) = histograms.made.get(&id) {
            return Some(made.clone());
        }
        if let Some(task) = histograms.in_work.get_mut(&id) {
            let made = block_on(poll_once(task))?;
            histograms.in_work.remove(&id);
            histograms.made.insert(id, made.clone());
            return Some(made);
        }
        let volume = world.resource::<Assets<Volume>>().get(id)?.clone();
        let task = AsyncComputeTaskPool::get().spawn(async move { histogram(&volume) });
        histograms.in_work.insert(id, task);
        None
    })
}

/// The editor of a transfer function.
pub(super) fn transfer(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    let Some(before) = world.get::<TransferFunction>(entity).cloned() else { return };
    let id = world.get::<CtVolume>(entity).map(|body| body.0.id());
    let range = id.and_then(|id| Some(world.resource::<Assets<Volume>>().get(id)?.range()));
    presets(ui, world, entity, id);
    let Some((id, [low, high])) = id.zip(range).filter(|(_, range)| range[1] > range[0]) else {
        ui.weak("The histogram is there when the volume is loaded.");
        return;
    };
    let heights = heights(world, id);
    let mut function = before.clone();
    let share = |value: f64| match before.scale {
        ValueScale::Values => ((value - low) / (high - low)) as f32,
        ValueScale::ShareOfRange => value as f32,
    };
    let value = |share: f32| match before.scale {
        ValueScale::Values => low + f64::from(share) * (high - low),
        ValueScale::ShareOfRange => f64::from(share),
    };
    let plot = Plot::new(ui, 130.0, Sense::click_and_drag());
    if let Some(heights) = &heights {
        plot.bars(heights, Color32::from_gray(70));
    }
    let sorted = function.sorted_points();
    let ends = [sorted.first().map(|first| (0.0, first.opacity)), sorted.last().map(|last| (1.0, last.opacity))];
    let inner = sorted.iter().map(|point| (share(point.value).clamp(0.0, 1.0), point.opacity));
    plot.curve(ends[0].into_iter().chain(inner).chain(ends[1]), Color32::from_gray(200));
    let memory = ui.id().with("chosen point");
    let mut chosen: Option<usize> = ui.data(|data| data.get_temp(memory));
    chosen = chosen.filter(|chosen| *chosen < function.points.len());
    let nearest = |at: egui::Pos2, points: &[ControlPoint]| {
        let far = |point: &ControlPoint| plot.at(share(point.value), point.opacity).distance(at);
        let nearest = points.iter().enumerate().min_by(|one, other| far(one.1).total_cmp(&far(other.1)));
        nearest.filter(|(_, point)| far(point) < REACH).map(|(index, _)| index)
    };
    let response = plot.response.clone();
    if (response.drag_started() || response.clicked() || response.secondary_clicked())
        && let Some(at) = ui.ctx().input(|input| input.pointer.press_origin()).or(response.interact_pointer_pos())
    {
        chosen = nearest(at, &function.points);
        response.request_focus();
    }
    if response.dragged()
        && let Some((index, at)) = chosen.zip(response.interact_pointer_pos())
    {
        let (x, y) = plot.place(at);
        (function.points[index].value, function.points[index].opacity) = (value(x), y);
    }
    if response.double_clicked()
        && chosen.is_none()
        && let Some(at) = response.interact_pointer_pos()
    {
        let (x, y) = plot.place(at);
        let colour = sorted.iter().rev().find(|point| share(point.value) <= x).or(sorted.first());
        let colour = colour.map_or([255; 3], |point| point.colour);
        function.points.push(ControlPoint { value: value(x), colour, opacity: y });
        chosen = Some(function.points.len() - 1);
    }
    let mut is_removed = response.secondary_clicked();
    if response.has_focus() {
        keys(ui, &mut function, &mut chosen, &mut is_removed, (high - low) * f64::from(share(high).max(1e-6)), &share);
    }
    if is_removed
        && let Some(index) = chosen.take()
        && function.points.len() > 1
    {
        function.points.remove(index);
    }
    for (index, point) in function.points.iter().enumerate() {
        let [red, green, blue] = point.colour;
        plot.handle(share(point.value), point.opacity, Color32::from_rgb(red, green, blue), chosen == Some(index));
    }
    plot.text(0.0, 0.0, Align2::LEFT_BOTTOM, &format!("{low:.0}"));
    plot.text(1.0, 0.0, Align2::RIGHT_BOTTOM, &format!("{high:.0}"));
    response.on_hover_text(
        "Opacity (up) by value (right: Hounsfield units for CT), over how often each value occurs. Drag a point; double-click adds \
         one, a right click takes one away. With the keyboard: N chooses the next point, arrows move it, Insert and Delete add and \
         remove.",
    );
    match chosen {
        Some(index) => point_fields(ui, &mut function.points[index], before.scale),
        None => {
            ui.weak("Choose a point to set its colour.");
        }
    }
    ui.data_mut(|data| {
        data.remove::<usize>(memory);
        chosen.map(|chosen| data.insert_temp(memory, chosen))
    });
    if function != before {
        edit(world, entity, function, "Transfer function");
    }
}

/// What the keyboard does to the points.
fn keys(
    ui: &egui::Ui,
    function: &mut TransferFunction,
    chosen: &mut Option<usize>,
    is_removed: &mut bool,
    span: f64,
    share: &dyn Fn(f64) -> f32,
) {
    ui.memory_mut(|memory| {
        if let Some(focused) = memory.focused() {
            let arrows = egui::EventFilter { horizontal_arrows: true, vertical_arrows: true, ..Default::default() };
            memory.set_focus_lock_filter(focused, arrows);
        }
    });
    let pressed = |key| ui.input(|input| input.key_pressed(key));
    if pressed(Key::N) {
        let mut order: Vec<usize> = (0..function.points.len()).collect();
        order.sort_by(|one, other| function.points[*one].value.total_cmp(&function.points[*other].value));
        let place = chosen.and_then(|chosen| order.iter().position(|index| *index == chosen));
        *chosen = order.get(place.map_or(0, |place| (place + 1) % order.len())).copied();
    }
    *is_removed |= pressed(Key::Delete);
    let Some(index) = *chosen else { return };
    let step = if share(span) > 1.5 || function.scale == ValueScale::Values { span } else { 1.0 } / 200.0;
    let point = &mut function.points[index];
    point.value += step * (f64::from(pressed(Key::ArrowRight) as u8) - f64::from(pressed(Key::ArrowLeft) as u8));
    let up = 0.02 * (f32::from(pressed(Key::ArrowUp) as u8) - f32::from(pressed(Key::ArrowDown) as u8));
    point.opacity = (point.opacity + up).clamp(0.0, 1.0);
    if pressed(Key::Insert) {
        let another = ControlPoint { value: point.value + 4.0 * step, ..*point };
        function.points.push(another);
        *chosen = Some(function.points.len() - 1);
    }
}

fn point_fields(ui: &mut egui::Ui, point: &mut ControlPoint, scale: ValueScale) {
    ui.horizontal(|ui| {
        let unit = match scale {
            ValueScale::Values => "in the volume's units (Hounsfield units for CT)",
            ValueScale::ShareOfRange => "as a share of the volume's range",
        };
        ui.add(egui::DragValue::new(&mut point.value).speed(1.0)).on_hover_text(format!("Value, {unit}"));
        ui.add(egui::Slider::new(&mut point.opacity, 0.0..=1.0)).on_hover_text("Opacity of a reference length, 0 to 1");
        ui.color_edit_button_srgb(&mut point.colour).on_hover_text("Colour, sRGB");
    });
}

fn presets(ui: &mut egui::Ui, world: &mut World, entity: Entity, volume: Option<AssetId<Volume>>) {
    ui.horizontal_wrapped(|ui| {
        ui.label("Preset").on_hover_text("Points, scale and colours, all at once");
        let ready: [(&str, &str, fn() -> TransferFunction); 5] = [
            ("Bone", "Bone in a CT with Hounsfield units", TransferFunction::bone),
            ("Soft tissue", "Skin and muscle as a veil over bone", TransferFunction::soft_tissue),
            ("Vessels", "Vessels with contrast medium", TransferFunction::vessels),
            ("Head", "A head scan from 0 to 1", TransferFunction::head),
            ("Structures", "Everything in the colours of its structures", TransferFunction::structures),
        ];
        for (name, told, make) in ready {
            if ui.small_button(name).on_hover_text(told).clicked() {
                edit(world, entity, make(), &format!("Transfer function: {}", name.to_lowercase()));
            }
        }
        let told = "The sensible one for this volume";
        if ui.add_enabled(volume.is_some(), egui::Button::new("Suited").small()).on_hover_text(told).clicked() {
            let suited = volume
                .and_then(|id| world.resource::<Assets<Volume>>().get(id))
                .map(|volume| Box::new(TransferFunction::for_volume(volume)) as Box<dyn Reflect>);
            if suited.is_some() {
                edit_component(world, entity, TypeId::of::<TransferFunction>(), suited, "Suited transfer function");
            }
        }
    });
}
