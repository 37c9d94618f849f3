//! Controls for fields: names, units, bounds, tooltips.

use super::{app, panel, shown};
use bevy::prelude::*;
use bevy::reflect::TypeInfo;
use bevy_egui::egui::{self, Order};
use bevy_surgery::panels::fields::{FieldContext, LIMITS, Unit, fields, label_of_field, label_of_type};
use bevy_surgery::panels::{EditHistory, undo};
use bevy_surgery::pool::PoolLook;
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::SceneComponents;
use bevy_surgery::testing::TestApp;
use egui::accesskit::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};

#[test]
fn names_say_their_units() {
    for (field, label, symbol, shown) in [
        ("ring_radius_m", "Ring radius", "mm", 1e3),
        ("field_of_view_rad", "Field of view", "°", 57.29578),
        ("irrigation_ml_s", "Irrigation", "ml/s", 1.0),
        ("viscosity_m2_s", "Viscosity", "m²/s", 1.0),
        ("jet_m_s", "Jet", "m/s", 1.0),
        ("drag_per_s", "Drag", "1/s", 1.0),
        ("vessel_pressure_mmhg", "Vessel pressure", "mmHg", 1.0),
        ("youngs_modulus_pa", "Youngs modulus", "Pa", 1.0),
        ("bleeding_ml_per_s_mm3", "Bleeding", "ml/(s·mm³)", 1.0),
        ("drop_volume_m3", "Drop volume", "ml", 1e6),
        ("is_sucking", "Sucking", "", 1.0),
        ("mottle", "Mottle", "", 1.0),
    ] {
        assert_eq!(label_of_field(field), label);
        let unit = Unit::of_field(field);
        assert_eq!(unit.symbol, symbol, "{field}");
        assert!((unit.shown_per_stored / shown - 1.0).abs() < 1e-6, "{field}");
    }
    assert_eq!(label_of_type("ScopeLight"), "Scope light");
}

#[test]
fn limits_are_those_of_fields_that_are_there() {
    let app = app();
    let registry = app.world().resource::<AppTypeRegistry>().read();
    for (name, field, limits) in LIMITS {
        let has = |info: &TypeInfo| matches!(info, TypeInfo::Struct(info) if info.field(field).is_some());
        let is_there = registry.iter().any(|it| {
            let info = it.type_info();
            info.type_path().starts_with("bevy_surgery") && info.type_path_table().short_path() == *name && has(info)
        });
        assert!(is_there, "{name} has no field {field}");
        assert!(limits.least < limits.greatest && (!limits.is_logarithmic || limits.least > 0.0), "{name}.{field}");
    }
}

/// Every component that a designer sets, at its default, within its limits.
#[test]
fn defaults_lie_within_their_limits() {
    let app = app();
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let mut compared = 0;
    for path in SceneComponents::authored_of_crate() {
        let known = registry.get_with_type_path(path).expect("registered");
        let Some(default) = known.data::<ReflectDefault>().map(ReflectDefault::default) else { continue };
        let bevy::reflect::ReflectRef::Struct(value) = default.reflect_ref() else { continue };
        let short = known.type_info().type_path_table().short_path();
        for (_, field, limits) in LIMITS.iter().filter(|(of, ..)| *of == short) {
            let value = value.field(field).expect("there, says another test");
            if let Some(number) = value.try_downcast_ref::<f32>() {
                let number = f64::from(*number);
                assert!((limits.least..=limits.greatest).contains(&number), "{short}.{field} is {number}");
                compared += 1;
            }
        }
    }
    assert!(compared > 20, "{compared}");
}

#[test]
fn a_slider_sets_a_field_and_one_undo_takes_it_back() {
    let mut app = app();
    let entity = app.world_mut().spawn((Name::new("organ"), Skin { mottle: 0.25, ..Skin::liver() })).id();
    let mut harness = panel(app, entity);
    harness.run_ok();
    let slider = harness.get_by_role_and_label(Role::Slider, "Mottle");
    let rect = slider.rect();
    let mottle = |harness: &Harness<TestApp>| harness.state().world().get::<Skin>(entity).expect("a skin").mottle;
    // Drawn along the slider in several frames.
    for share in [0.3, 0.5, 0.7, 0.9] {
        harness.hover_at(rect.left_center() + egui::vec2(rect.width() * share, 0.0));
        if share == 0.3 {
            harness.drag_at(rect.left_center() + egui::vec2(rect.width() * share, 0.0));
        }
        harness.run_ok();
    }
    harness.drop_at(rect.left_center() + egui::vec2(rect.width() * 0.9, 0.0));
    harness.run_ok();
    let set = mottle(&harness);
    assert!((0.8..=1.0).contains(&set), "{set}");
    let world = harness.state_mut().world_mut();
    assert_eq!(world.resource::<EditHistory>().titles().collect::<Vec<_>>(), ["Skin"]);
    assert!(undo(world));
    assert!(!undo(world), "a drag is one edit");
    assert_eq!(mottle(&harness), 0.25);
}

#[test]
fn the_keyboard_alone_sets_a_field() {
    let mut app = app();
    let entity = app.world_mut().spawn((Name::new("organ"), Skin { mottle: 0.5, ..Skin::liver() })).id();
    let mut harness = panel(app, entity);
    harness.run_ok();
    // Tab as often as it takes to reach the slider, then an arrow.
    let mut presses = 0;
    while !harness.get_by_role_and_label(Role::Slider, "Mottle").accesskit_node().is_focused() {
        harness.key_press(egui::Key::Tab);
        harness.run_ok();
        presses += 1;
        assert!(presses < 60, "the slider is never reached");
    }
    harness.key_press(egui::Key::ArrowRight);
    harness.run_ok();
    let set = harness.state().world().get::<Skin>(entity).expect("a skin").mottle;
    assert!(set > 0.5 && set < 0.6, "{set}");
}

#[test]
fn a_preset_is_one_edit() {
    let mut app = app();
    let entity = app.world_mut().spawn((Name::new("organ"), Skin { seed: 9, ..Skin::liver() })).id();
    let mut harness = panel(app, entity);
    harness.run_ok();
    harness.get_by_role_and_label(Role::Button, "Kidney").click();
    harness.run_ok();
    let world = harness.state_mut().world_mut();
    assert_eq!(world.get::<Skin>(entity), Some(&Skin { seed: 9, ..Skin::kidney() }));
    undo(world);
    assert_eq!(world.get::<Skin>(entity), Some(&Skin { seed: 9, ..Skin::liver() }));
}

/// Whether a tooltip is seen just now.
fn has_tooltip(harness: &Harness<TestApp>) -> bool {
    harness.ctx.memory(|memory| memory.areas().visible_layer_ids().iter().any(|layer| layer.order == Order::Tooltip))
}

/// Hovers over every control of a panel, and names those without a tooltip.
fn without_tooltip(harness: &mut Harness<'static, TestApp>) -> (usize, Vec<String>) {
    harness.ctx.all_styles_mut(|style| {
        style.interaction.tooltip_delay = 0.0;
        style.interaction.show_tooltips_only_when_still = false;
    });
    harness.run_ok();
    let controls = [
        Role::Button,
        Role::CheckBox,
        Role::Slider,
        Role::SpinButton,
        Role::ComboBox,
        Role::TextInput,
        Role::ColorWell,
    ];
    let mut found = Vec::new();
    for role in controls {
        for node in harness.query_all_by_role(role) {
            let name = node.accesskit_node().label().unwrap_or_default();
            found.push((role, name, node.rect()));
        }
    }
    let mut missing = Vec::new();
    for (role, name, rect) in &found {
        harness.hover_at(egui::pos2(1.0, 1.0));
        harness.run_ok();
        harness.hover_at(rect.center());
        harness.run_ok();
        if !has_tooltip(harness) {
            missing.push(format!("{role:?} \"{name}\" at {rect:?}"));
        }
    }
    (found.len(), missing)
}

#[test]
fn every_control_has_a_tooltip() {
    let mut app = app();
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let paths = SceneComponents::authored_of_crate();
    let mut controls = 0;
    for path in paths {
        let known = registry.get_with_type_path(path).expect("registered");
        let Some(default) = known.data::<ReflectDefault>().map(ReflectDefault::default) else { continue };
        let types = app.world().resource::<AppTypeRegistry>().clone();
        let mut harness = shown(std::mem::replace(&mut app, super::app()), move |ui, world| {
            let registry = types.read();
            let mut value = default.reflect_clone().expect("cloneable");
            fields(ui, value.as_partial_reflect_mut(), &FieldContext::new(world, &registry));
        });
        let (found, missing) = without_tooltip(&mut harness);
        controls += found;
        assert!(missing.is_empty(), "{path}: {missing:#?}");
    }
    assert!(controls > 150, "only {controls} controls were looked at");
}

#[test]
fn what_has_no_tooltip_is_found() {
    let mut harness = shown(app(), |ui, _| {
        let _ = ui.button("silent");
        ui.button("told").on_hover_text("what it does");
    });
    let (found, missing) = without_tooltip(&mut harness);
    assert_eq!((found, missing.len()), (2, 1));
    assert!(missing[0].contains("silent"));
}

#[test]
fn sections_of_an_organ_have_tooltips_throughout() {
    let mut app = app();
    let organ = (Name::new("organ"), Skin::liver(), Reactions::default(), Highlights::default(), PoolLook::default());
    let entity = app.world_mut().spawn(organ).id();
    let (found, missing) = without_tooltip(&mut panel(app, entity));
    assert!(found > 15, "{found}");
    assert!(missing.is_empty(), "{missing:#?}");
}

#[test]
fn numbers_are_shown_in_their_unit_and_kept_in_theirs() {
    let mut app = app();
    let entity = app.world_mut().spawn((Name::new("eye"), ScopeLight { ring_radius_m: 0.0125, ..default() })).id();
    let mut harness = shown(app, move |ui, world| {
        let registry = world.resource::<AppTypeRegistry>().clone();
        let registry = registry.read();
        let mut light = world.get::<ScopeLight>(entity).cloned().expect("a light");
        let is_changed = fields(ui, &mut light, &FieldContext::new(world, &registry));
        assert!(!is_changed, "looking at it changes nothing");
    });
    harness.run_ok();
    let slider = harness.get_by_role_and_label(Role::Slider, "Ring radius");
    let shown = slider.accesskit_node().numeric_value().expect("a number");
    assert!((shown - 12.5).abs() < 1e-4, "{shown} mm");
}
