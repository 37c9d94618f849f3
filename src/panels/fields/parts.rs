//! Controls for kinds of values.

use super::number::number;
use super::{FieldContext, Place, Unit, inner, label_of_field, label_of_type, labelled, place_of, plain, row};
use bevy::asset::ReflectHandle;
use bevy::math::EulerRot;
use bevy::prelude::*;
use bevy::reflect::enums::{DynamicEnum, DynamicVariant, VariantInfo, VariantType};
use bevy::reflect::structs::DynamicStruct;
use bevy::reflect::tuple::DynamicTuple;
use bevy::reflect::{PartialReflect, ReflectMut, ReflectRef, TypeInfo};
use bevy_egui::egui;
use std::any::TypeId;
use std::path::PathBuf;

/// Does something with a number of any type.
macro_rules! as_number {
    ($value:expr, $ui:expr, $place:expr; $($kind:ty => $is_whole:literal),*) => {
        $(if let Some(stored) = $value.try_downcast_mut::<$kind>() {
            let mut wide = *stored as f64;
            let response = number($ui, &mut wide, $is_whole, $place);
            if wide != *stored as f64 {
                // Casts end at the bounds of the type.
                *stored = if $is_whole { wide.round() as $kind } else { wide as $kind };
            }
            return response;
        })*
    };
}

/// Does something with each number of a vector.
macro_rules! as_vector {
    ($value:expr, $ui:expr, $place:expr; $($kind:ty : $is_whole:literal, $number:ty),*) => {
        $(if let Some(stored) = $value.try_downcast_mut::<$kind>() {
            let mut numbers: Vec<f64> = stored.to_array().iter().map(|number| f64::from(*number)).collect();
            let response = several($ui, &mut numbers, $is_whole, $place);
            if response.changed() {
                let mut numbers = numbers.into_iter();
                *stored = <$kind>::from_array(std::array::from_fn(|_| numbers.next().unwrap_or(0.0) as $number));
            }
            return response;
        })*
    };
}

/// Whether a value has one control.
pub(super) fn is_single(value: &dyn PartialReflect) -> bool {
    let Some(info) = value.get_represented_type_info() else { return true };
    let singles = [
        TypeId::of::<Color>(),
        TypeId::of::<Vec2>(),
        TypeId::of::<Vec3>(),
        TypeId::of::<Vec4>(),
        TypeId::of::<bevy::math::DVec3>(),
        TypeId::of::<UVec2>(),
        TypeId::of::<UVec3>(),
        TypeId::of::<Quat>(),
        TypeId::of::<Name>(),
        TypeId::of::<[u8; 3]>(),
        TypeId::of::<[u8; 4]>(),
    ];
    matches!(value.reflect_ref(), ReflectRef::Opaque(_)) || singles.contains(&info.type_id()) || is_handle(info)
}

fn is_handle(info: &TypeInfo) -> bool {
    info.type_path().starts_with("bevy_asset::handle::Handle<")
}

/// What is written behind the name of a value whose control has no room for it.
pub(super) fn unit_beside<'a>(value: &dyn PartialReflect, place: &Place<'a>) -> &'static str {
    let Some(info) = value.get_represented_type_info() else { return "" };
    let several = [TypeId::of::<Vec2>(), TypeId::of::<Vec3>(), TypeId::of::<Vec4>(), TypeId::of::<bevy::math::DVec3>()];
    match info.type_id() {
        kind if kind == TypeId::of::<Quat>() => "°",
        kind if several.contains(&kind) && !place.field.ends_with("colour") => place.unit.symbol,
        _ => "",
    }
}

/// Whether a value is one of several names.
pub(super) fn is_unit_enum(value: &dyn PartialReflect) -> bool {
    match value.get_represented_type_info() {
        Some(TypeInfo::Enum(info)) => info.iter().all(|variant| variant.variant_type() == VariantType::Unit),
        _ => false,
    }
}

/// The control for a value that has one.
pub(super) fn control(
    ui: &mut egui::Ui,
    value: &mut dyn PartialReflect,
    place: Place,
    context: &FieldContext,
) -> egui::Response {
    as_number!(value, ui, place;
        f32 => false, f64 => false, u8 => true, u16 => true, u32 => true, u64 => true, usize => true, i8 => true, i16 => true,
        i32 => true, i64 => true);
    if let Some(stored) = value.try_downcast_mut::<bool>() {
        return ui.checkbox(stored, "");
    }
    if let Some(stored) = value.try_downcast_mut::<Color>() {
        return colour(ui, stored);
    }
    if place.field.ends_with("colour")
        && let Some(stored) = value.try_downcast_mut::<Vec3>()
    {
        let mut rgb = stored.to_array();
        let response = ui.color_edit_button_rgb(&mut rgb);
        *stored = rgb.into();
        return response;
    }
    if let Some(stored) = value.try_downcast_mut::<[u8; 3]>() {
        return ui.color_edit_button_srgb(stored);
    }
    if let Some(stored) = value.try_downcast_mut::<[u8; 4]>() {
        return ui.color_edit_button_srgba_unmultiplied(stored);
    }
    as_vector!(value, ui, place;
        Vec2: false, f32, Vec3: false, f32, Vec4: false, f32, bevy::math::DVec3: false, f64, UVec2: true, u32, UVec3: true, u32);
    if let Some(stored) = value.try_downcast_mut::<Quat>() {
        return rotation(ui, stored);
    }
    if let Some(stored) = value.try_downcast_mut::<String>() {
        return text(ui, stored);
    }
    if let Some(stored) = value.try_downcast_mut::<Name>() {
        let mut name = stored.to_string();
        let response = text(ui, &mut name);
        if name != stored.as_str() {
            stored.set(name);
        }
        return response;
    }
    if let Some(stored) = value.try_downcast_mut::<PathBuf>() {
        let mut path = stored.to_string_lossy().into_owned();
        let response = text(ui, &mut path);
        if path != stored.to_string_lossy() {
            *stored = path.into();
        }
        return response;
    }
    if let Some(stored) = value.try_downcast_mut::<Entity>() {
        return entity(ui, stored, context);
    }
    if is_unit_enum(value) {
        return variant(ui, value, context);
    }
    if let Some(file) = file_of(value, context) {
        return ui.label(file);
    }
    ui.weak("is not set by hand")
}

fn colour(ui: &mut egui::Ui, stored: &mut Color) -> egui::Response {
    let srgba = stored.to_srgba();
    let mut shown = srgba.to_u8_array();
    let response = ui.color_edit_button_srgba_unmultiplied(&mut shown);
    if shown != srgba.to_u8_array() {
        *stored = Color::srgba_u8(shown[0], shown[1], shown[2], shown[3]);
    }
    response
}

/// Several numbers in a row, as one control.
fn several(ui: &mut egui::Ui, numbers: &mut [f64], is_whole: bool, place: Place) -> egui::Response {
    let count = numbers.len() as f32;
    let inner = ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        ui.spacing_mut().interact_size.x = ((ui.available_width() - 3.0 * count) / count).clamp(30.0, 90.0);
        let mut all: Option<egui::Response> = None;
        for (axis, stored) in numbers.iter_mut().enumerate() {
            let before = *stored;
            // Without the symbol: three of them would not fit.
            let unit = Unit { symbol: "", ..place.unit };
            let mut one = number(ui, stored, is_whole, Place { unit, limits: None, ..place });
            if *stored != before {
                one.mark_changed();
            }
            let axis = ["x", "y", "z", "w"].get(axis).copied().unwrap_or_default();
            let told = format!("{axis}, {}\n{}", place.unit.symbol, plain(place.meaning));
            let one = one.on_hover_text(told.trim());
            all = Some(match all {
                Some(all) => all.union(one),
                None => one,
            });
        }
        all
    });
    inner.inner.unwrap_or(inner.response)
}

/// A rotation as angles about y, x and z, in degrees.
fn rotation(ui: &mut egui::Ui, stored: &mut Quat) -> egui::Response {
    let (y, x, z) = stored.to_euler(EulerRot::YXZ);
    let mut angles = [x, y, z].map(f64::from);
    let meaning = "About this axis; first z, then x, then y.";
    let place = Place { field: "_rad", unit: Unit::of_field("_rad"), limits: None, meaning };
    let response = several(ui, &mut angles, false, place);
    if response.changed() {
        let [x, y, z] = angles.map(|angle| angle as f32);
        *stored = Quat::from_euler(EulerRot::YXZ, y, x, z);
    }
    response
}

/// A text that counts when the hand has left it.
fn text(ui: &mut egui::Ui, stored: &mut String) -> egui::Response {
    let id = ui.next_auto_id();
    let mut typed = ui.data(|data| data.get_temp::<String>(id)).unwrap_or_else(|| stored.clone());
    let response = ui.add(egui::TextEdit::singleline(&mut typed).desired_width(ui.available_width() - 8.0));
    if response.has_focus() {
        ui.data_mut(|data| data.insert_temp(id, typed));
    } else if response.lost_focus() {
        ui.data_mut(|data| data.remove::<String>(id));
        *stored = typed;
    }
    response
}

fn entity(ui: &mut egui::Ui, stored: &mut Entity, context: &FieldContext) -> egui::Response {
    let before = *stored;
    let name = context.entities.iter().find(|(entity, _)| *entity == before);
    let shown = name.map_or_else(|| format!("{before}"), |(_, name)| name.clone());
    let mut response = egui::ComboBox::from_id_salt(ui.next_auto_id())
        .selected_text(shown)
        .width(ui.available_width() - 8.0)
        .show_ui(ui, |ui| {
            for (entity, name) in &context.entities {
                ui.selectable_value(stored, *entity, name).on_hover_text(format!("{name} ({entity})"));
            }
        })
        .response;
    if *stored != before {
        response.mark_changed();
    }
    response
}

/// The file that a handle leads to.
fn file_of(value: &dyn PartialReflect, context: &FieldContext) -> Option<String> {
    let info = value.get_represented_type_info().filter(|info| is_handle(info))?;
    let reflected = context.registry.get_type_data::<ReflectHandle>(info.type_id())?;
    let handle = reflected.downcast_handle_untyped(value.try_as_reflect()?.as_any())?;
    Some(context.path_of(handle.id()).unwrap_or_else(|| "made by the program".into()))
}

/// One of several names.
fn variant(ui: &mut egui::Ui, value: &mut dyn PartialReflect, context: &FieldContext) -> egui::Response {
    let Some(TypeInfo::Enum(info)) = value.get_represented_type_info() else { return ui.label("") };
    let now = match value.reflect_ref() {
        ReflectRef::Enum(value) => value.variant_name().to_owned(),
        _ => String::new(),
    };
    let mut chosen = now.clone();
    let mut response = egui::ComboBox::from_id_salt(ui.next_auto_id())
        .selected_text(label_of_type(&now))
        .width((ui.available_width() - 8.0).min(200.0))
        .show_ui(ui, |ui| {
            for variant in info.iter() {
                let name = variant.name();
                let can_be = default_of(variant, context).is_some();
                let label = label_of_type(name);
                let choice = ui.add_enabled(can_be, egui::Button::selectable(chosen == name, &label));
                let told = variant.docs().map_or_else(|| label.clone(), plain);
                if choice.on_hover_text(told).clicked() {
                    chosen = name.to_owned();
                }
            }
        })
        .response;
    if chosen != now
        && let Some(variant) = info.variant(&chosen)
        && let Some(fields) = default_of(variant, context)
        && value.try_apply(&DynamicEnum::new(chosen, fields)).is_ok()
    {
        response.mark_changed();
    }
    response
}

/// A variant with what its fields are by default; none where a field has no default.
fn default_of(variant: &VariantInfo, context: &FieldContext) -> Option<DynamicVariant> {
    Some(match variant {
        VariantInfo::Unit(_) => DynamicVariant::Unit,
        VariantInfo::Tuple(info) => {
            let mut fields = DynamicTuple::default();
            for field in info.iter() {
                fields.insert_boxed(default_value(field.type_id(), context)?.into_partial_reflect());
            }
            DynamicVariant::Tuple(fields)
        }
        VariantInfo::Struct(info) => {
            let mut fields = DynamicStruct::default();
            for field in info.iter() {
                fields.insert_boxed(field.name(), default_value(field.type_id(), context)?.into_partial_reflect());
            }
            DynamicVariant::Struct(fields)
        }
    })
}

fn default_value(kind: TypeId, context: &FieldContext) -> Option<Box<dyn Reflect>> {
    if kind == TypeId::of::<Entity>() {
        return Some(Box::new(context.entities.first()?.0));
    }
    Some(context.registry.get_type_data::<ReflectDefault>(kind)?.default())
}

/// A choice, and the fields of what is chosen.
pub(super) fn variant_and_fields(
    ui: &mut egui::Ui,
    value: &mut dyn PartialReflect,
    place: Place,
    context: &FieldContext,
) -> bool {
    let told = super::tooltip("Which of these it is.", place);
    let mut is_changed = labelled(ui, "Kind", &told, |ui| variant(ui, value, context));
    let Some(TypeInfo::Enum(info)) = value.get_represented_type_info() else { return is_changed };
    let ReflectMut::Enum(parts) = value.reflect_mut() else { return is_changed };
    let variant = info.variant(parts.variant_name());
    let of = label_of_type(parts.variant_name());
    for index in 0..parts.field_len() {
        let name = parts.name_at(index).map(str::to_owned);
        let docs = match (&variant, &name) {
            (Some(VariantInfo::Struct(info)), Some(name)) => info.field(name).and_then(|field| field.docs()),
            _ => None,
        };
        let Some(part) = parts.field_at_mut(index) else { continue };
        is_changed |= match &name {
            Some(name) => {
                row(ui, &label_of_field(name), part, place_of(info.type_path_table().short_path(), name, docs), context)
            }
            // An Option's value is what its field is called.
            None if info.type_path().starts_with("core::option::Option<") => row(ui, "Value", part, place, context),
            None => row(ui, &of, part, Place { meaning: docs.unwrap_or_default(), ..place }, context),
        };
    }
    is_changed
}

/// A value with parts, to be unfolded.
pub(super) fn unfolded(
    ui: &mut egui::Ui,
    label: &str,
    told: &str,
    value: &mut dyn PartialReflect,
    place: Place,
    context: &FieldContext,
) -> bool {
    let count = match value.reflect_ref() {
        ReflectRef::List(list) => format!("{label} ({})", list.len()),
        _ => label.to_owned(),
    };
    let folded = egui::CollapsingHeader::new(count).id_salt(label).show(ui, |ui| match value.reflect_mut() {
        ReflectMut::List(_) => list(ui, value, place, context),
        ReflectMut::Array(array) => (0..array.len()).fold(false, |is_changed, index| {
            let Some(item) = array.get_mut(index) else { return is_changed };
            row(ui, &(index + 1).to_string(), item, place, context) | is_changed
        }),
        ReflectMut::Struct(_) | ReflectMut::TupleStruct(_) | ReflectMut::Enum(_) => inner(ui, value, place, context),
        _ => {
            ui.weak("is not set by hand");
            false
        }
    });
    folded.header_response.on_hover_text(told);
    folded.body_returned.unwrap_or(false)
}

/// Items that can be added and removed.
fn list(ui: &mut egui::Ui, value: &mut dyn PartialReflect, place: Place, context: &FieldContext) -> bool {
    let item_type = match value.get_represented_type_info() {
        Some(TypeInfo::List(info)) => Some(info.item_ty().id()),
        _ => None,
    };
    let ReflectMut::List(items) = value.reflect_mut() else { return false };
    let mut is_changed = false;
    let mut removed = None;
    for index in 0..items.len() {
        ui.horizontal(|ui| {
            if ui.small_button("×").on_hover_text(format!("Removes entry {}", index + 1)).clicked() {
                removed = Some(index);
            }
            let Some(item) = items.get_mut(index) else { return };
            ui.vertical(|ui| is_changed |= row(ui, &(index + 1).to_string(), item, place, context));
        });
    }
    if let Some(index) = removed {
        items.remove(index);
        is_changed = true;
    }
    // Another one like the last; the first as its type is by default.
    let another =
        items.len().checked_sub(1).and_then(|last| items.get(last)).and_then(|last| last.reflect_clone().ok());
    let another = another.or_else(|| default_value(item_type?, context));
    let told = "Adds an entry: one like the last.";
    if ui.add_enabled(another.is_some(), egui::Button::new("Add").small()).on_hover_text(told).clicked()
        && let Some(another) = another
    {
        items.push(another.into_partial_reflect());
        is_changed = true;
    }
    is_changed
}
