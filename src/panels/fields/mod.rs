//! Controls for values that are known by reflection: every component of the crate can be edited by them.
//!
//! Names of fields carry their unit and their documentation says what they mean, so both are shown without being said again:
//! `ring_radius_m` becomes "Ring radius" in millimetres, and its tooltip is its documentation.

mod limits;
mod number;
mod parts;
mod units;

pub use limits::{LIMITS, Limits, limits};
pub use units::{Unit, label_of_field, label_of_type};

use bevy::asset::UntypedAssetId;
use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy::reflect::{PartialReflect, ReflectMut, TypeInfo, TypeRegistry};
use bevy_egui::egui;

/// What controls look up beside the value.
pub struct FieldContext<'a> {
    registry: &'a TypeRegistry,
    assets: Option<AssetServer>,
    /// Entities with names, in the order of these.
    entities: Vec<(Entity, String)>,
}

impl<'a> FieldContext<'a> {
    /// For the entities of a world. `registry` is the world's.
    pub fn new(world: &World, registry: &'a TypeRegistry) -> Self {
        let mut entities: Vec<_> = world
            .archetypes()
            .iter()
            .flat_map(|archetype| archetype.entities())
            .map(|entity| world.entity(entity.id()))
            .filter(|entity| !entity.contains::<Disabled>())
            .filter_map(|entity| Some((entity.id(), entity.get::<Name>()?.to_string())))
            .collect();
        entities.sort_by(|(one, name), (other, of)| name.cmp(of).then(one.cmp(other)));
        Self { registry, assets: world.get_resource().cloned(), entities }
    }

    fn path_of(&self, asset: UntypedAssetId) -> Option<String> {
        Some(self.assets.as_ref()?.get_path(asset)?.to_string())
    }
}

/// What is known of a place in a value.
#[derive(Clone, Copy)]
struct Place<'a> {
    /// The field's name, or that of the nearest one around it.
    field: &'a str,
    unit: Unit,
    limits: Option<Limits>,
    /// What a tooltip says.
    meaning: &'a str,
}

/// Controls for all fields of a value; whether it was changed.
pub fn fields(ui: &mut egui::Ui, value: &mut dyn PartialReflect, context: &FieldContext) -> bool {
    let meaning = value.get_represented_type_info().and_then(TypeInfo::docs).unwrap_or_default();
    let place = Place { field: "", unit: Unit::PLAIN, limits: None, meaning };
    ui.push_id(value.reflect_type_path().to_owned(), |ui| inner(ui, value, place, context)).inner
}

/// Controls for the parts of a value, below one another.
fn inner(ui: &mut egui::Ui, value: &mut dyn PartialReflect, place: Place, context: &FieldContext) -> bool {
    if parts::is_single(value) {
        let of = value.get_represented_type_info().map_or("Value", |info| info.type_path_table().short_path());
        return row(ui, if of == "Name" { of } else { "Value" }, value, place, context);
    }
    let info = value.get_represented_type_info();
    let of = info.map_or("", |info| info.type_path_table().short_path());
    let mut is_changed = false;
    match value.reflect_mut() {
        ReflectMut::Struct(parts) => {
            for index in 0..parts.field_len() {
                let name = parts.name_at(index).unwrap_or_default().to_owned();
                let docs = match info {
                    Some(TypeInfo::Struct(info)) => info.field_at(index).and_then(|field| field.docs()),
                    _ => None,
                };
                let place = place_of(of, &name, docs);
                let Some(part) = parts.field_at_mut(index) else { continue };
                is_changed |= row(ui, &label_of_field(&name), part, place, context);
            }
        }
        ReflectMut::TupleStruct(parts) => {
            let is_single = parts.field_len() == 1;
            for index in 0..parts.field_len() {
                let Some(part) = parts.field_mut(index) else { continue };
                is_changed |= if is_single {
                    inner(ui, part, place, context)
                } else {
                    row(ui, &(index + 1).to_string(), part, place, context)
                };
            }
        }
        ReflectMut::Enum(_) => is_changed |= parts::variant_and_fields(ui, value, place, context),
        _ => is_changed |= row(ui, "Value", value, place, context),
    }
    is_changed
}

fn place_of<'a>(of: &str, field: &'a str, docs: Option<&'a str>) -> Place<'a> {
    Place {
        field,
        unit: Unit::of_field(field),
        limits: limits(of, field),
        meaning: docs.map(str::trim).unwrap_or_default(),
    }
}

/// What a tooltip says of a place: what it means, its unit and its bounds.
fn tooltip(label: &str, place: Place) -> String {
    let mut text = if place.meaning.is_empty() { label.to_owned() } else { plain(place.meaning) };
    if !place.unit.symbol.is_empty() {
        text += &format!("\nUnit: {}", place.unit.symbol);
    }
    if let Some(limits) = place.limits {
        let shown = |stored: f64| number::short(stored * place.unit.shown_per_stored);
        text += &format!("\nFrom {} to {}", shown(limits.least), shown(limits.greatest));
    }
    text
}

/// Documentation without its links.
pub(super) fn plain(docs: &str) -> String {
    let mut text = String::new();
    let mut rest = docs.trim();
    while let Some(start) = rest.find('[') {
        text += &rest[..start];
        rest = &rest[start + 1..];
        let Some(end) = rest.find(']') else { break };
        text += &rest[..end];
        rest = &rest[end + 1..];
        if rest.starts_with('(')
            && let Some(end) = rest.find(')')
        {
            rest = &rest[end + 1..];
        }
    }
    text += rest;
    text.replace('`', "").lines().map(str::trim).collect::<Vec<_>>().join(" ")
}

/// A value with its name: in one row where it fits there, otherwise as a part that can be unfolded.
fn row(ui: &mut egui::Ui, label: &str, value: &mut dyn PartialReflect, place: Place, context: &FieldContext) -> bool {
    let told = tooltip(label, place);
    if !parts::is_single(value) && !parts::is_unit_enum(value) {
        return ui.push_id(label, |ui| parts::unfolded(ui, label, &told, value, place, context)).inner;
    }
    let label = match parts::unit_beside(value, &place) {
        "" => label.to_owned(),
        unit => format!("{label}, {unit}"),
    };
    labelled(ui, &label, &told, |ui| parts::control(ui, value, place, context))
}

/// A name at the left and a control at the right, both with the tooltip; whether the control changed something.
pub fn labelled(
    ui: &mut egui::Ui,
    label: &str,
    told: &str,
    control: impl FnOnce(&mut egui::Ui) -> egui::Response,
) -> bool {
    ui.horizontal(|ui| {
        let width = (ui.available_width() * 0.45).max(90.0);
        let height = ui.spacing().interact_size.y;
        let name = ui
            .allocate_ui_with_layout(
                egui::vec2(width, height),
                egui::Layout::left_to_right(egui::Align::Center),
                |ui| {
                    ui.set_min_width(width);
                    ui.add(egui::Label::new(label).truncate().show_tooltip_when_elided(false))
                },
            )
            .inner
            .on_hover_text(told);
        control(ui).labelled_by(name.id).on_hover_text(told).changed()
    })
    .inner
}
