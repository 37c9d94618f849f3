//! Every component of the crate that a designer sets comes back from a file as it was.

use super::saved_and_loaded;
use bevy::ecs::reflect::AppTypeRegistry;
use bevy::prelude::*;
use bevy::reflect::{PartialReflect, ReflectMut, TypeInfo, TypeRegistry};
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::SceneComponents;
use bevy_surgery::testing::TestApp;
use std::collections::BTreeSet;

/// What has no default, and how it is looked at instead.
const BY_HAND: &[(&str, &str)] = &[
    ("bevy_surgery::deform::lattice::field::DeformLattice", "lattices_and_bodies_come_back"),
    ("bevy_surgery::deform::elastic::body::ElasticBody", "lattices_and_bodies_come_back"),
    ("bevy_surgery::pool::component::Pool", "entities_are_those_of_the_new_world"),
    ("bevy_surgery::view::stereo::MonitorView", "entities_are_those_of_the_new_world"),
    // Their handles need a file.
    ("bevy_surgery::organ::shape::Organ", "handles_lead_to_the_same_files"),
    ("bevy_surgery::volume::component::CtVolume", "handles_lead_to_the_same_files"),
];

/// Makes every number, switch and text in a value another one.
fn alter(value: &mut dyn PartialReflect, altered: &mut u32) {
    macro_rules! number {
        ($($kind:ty => $by:expr),*) => {$(
            if let Some(number) = value.try_downcast_mut::<$kind>() {
                *number = $by(*number);
                *altered += 1;
                return;
            }
        )*};
    }
    number!(
        f32 => |x| x * 1.25 + 0.013, f64 => |x| x * 1.25 + 0.013, u8 => |x: u8| x ^ 5, u32 => |x: u32| x ^ 5,
        u64 => |x: u64| x ^ 5, usize => |x: usize| x ^ 5, bool => |x: bool| !x
    );
    if let Some(text) = value.try_downcast_mut::<String>() {
        text.push_str(" \"é\" (::)");
        *altered += 1;
        return;
    }
    if let Some(path) = value.try_downcast_mut::<std::path::PathBuf>() {
        path.push("a folder/ä.nrrd");
        *altered += 1;
        return;
    }
    match value.reflect_mut() {
        ReflectMut::Struct(it) => {
            (0..it.field_len()).for_each(|n| alter(it.field_at_mut(n).expect("it is there"), altered))
        }
        ReflectMut::TupleStruct(it) => {
            (0..it.field_len()).for_each(|n| alter(it.field_mut(n).expect("it is there"), altered))
        }
        ReflectMut::Tuple(it) => {
            (0..it.field_len()).for_each(|n| alter(it.field_mut(n).expect("it is there"), altered))
        }
        ReflectMut::Enum(it) => {
            (0..it.field_len()).for_each(|n| alter(it.field_at_mut(n).expect("it is there"), altered))
        }
        ReflectMut::List(it) => (0..it.len()).for_each(|n| alter(it.get_mut(n).expect("it is there"), altered)),
        ReflectMut::Array(it) => (0..it.len()).for_each(|n| alter(it.get_mut(n).expect("it is there"), altered)),
        _ => {}
    }
}

pub fn authored() -> Vec<&'static str> {
    let by_hand = |path: &&str| BY_HAND.iter().any(|(other, _)| other == path);
    SceneComponents::authored_of_crate().into_iter().filter(|path| !by_hand(path)).collect()
}

fn default_of(path: &str, registry: &TypeRegistry) -> Box<dyn Reflect> {
    let registration = registry.get_with_type_path(path).unwrap_or_else(|| panic!("{path} is not registered"));
    registration.data::<ReflectDefault>().unwrap_or_else(|| panic!("{path} has no default")).default()
}

fn reflected<'a>(world: &'a World, entity: Entity, path: &str, registry: &TypeRegistry) -> &'a dyn Reflect {
    let registration = registry.get_with_type_path(path).expect("it is registered");
    let component = registration.data::<ReflectComponent>().expect("it is a component");
    component.reflect(world.entity(entity)).unwrap_or_else(|| panic!("{path} did not come back"))
}

/// Spawns a component with other numbers than its default's; returns how many there are.
pub fn altered(world: &mut World, path: &str) -> (Entity, u32) {
    let registry = world.resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let mut value = default_of(path, &registry);
    let mut numbers = 0;
    alter(value.as_partial_reflect_mut(), &mut numbers);
    // Without a name some are taken for those that the simulation made.
    let entity = world.spawn(Name::new(path.to_string())).id();
    let component = registry.get_with_type_path(path).and_then(|it| it.data::<ReflectComponent>());
    let component = component.expect("it is a component");
    component.insert(&mut world.entity_mut(entity), value.as_partial_reflect(), &registry);
    (entity, numbers)
}

#[test]
fn every_component_comes_back_as_it_was() {
    let mut app = TestApp::cpu();
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let mut entities = Vec::new();
    for path in authored() {
        let (entity, numbers) = altered(app.world_mut(), path);
        entities.push((path, entity, numbers));
    }
    let (text, fresh, map) = saved_and_loaded(&app);
    for (path, entity, numbers) in entities {
        let (before, after) =
            (reflected(app.world(), entity, path, &registry), reflected(fresh.world(), map[&entity], path, &registry));
        let is_equal = after.reflect_partial_eq(before.as_partial_reflect());
        assert_eq!(is_equal, Some(true), "{path}: {before:?} became {after:?}\n{text}");
        let is_default = before.reflect_partial_eq(default_of(path, &registry).as_partial_reflect());
        assert!(numbers == 0 || is_default == Some(false), "{path}: only its default was tried");
    }
}

/// What is not in the file takes its default: so fields can be added without a new version.
#[test]
fn fields_that_are_missing_take_their_defaults() {
    let app = TestApp::cpu();
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    for path in authored() {
        let default = default_of(path, &registry);
        if !matches!(default.get_represented_type_info(), Some(TypeInfo::Struct(_))) {
            continue;
        }
        let text = format!("(resources: {{}}, entities: {{1: (components: {{\"{path}\": ()}})}})");
        let mut fresh = TestApp::cpu();
        let loaded = bevy_surgery::scenes::load_scene(fresh.world_mut(), "test", &text);
        let entities = loaded.unwrap_or_else(|error| panic!("{path}: {error}"));
        let entity = *entities.values().next().expect("an entity");
        let after = reflected(fresh.world(), entity, path, &registry);
        assert_eq!(after.reflect_partial_eq(default.as_partial_reflect()), Some(true), "{path}: {after:?}");
    }
}

/// Types of the crate within a component: without a default, a part that lacks a field would be dropped as a whole.
fn parts(info: &TypeInfo, registry: &TypeRegistry, found: &mut BTreeSet<&'static str>) {
    let mut inner = Vec::new();
    match info {
        TypeInfo::Struct(it) => inner.extend(it.iter().map(|field| field.type_id())),
        TypeInfo::TupleStruct(it) => inner.extend(it.iter().map(|field| field.type_id())),
        TypeInfo::Tuple(it) => inner.extend(it.iter().map(|field| field.type_id())),
        TypeInfo::List(it) => inner.push(it.item_ty().id()),
        TypeInfo::Array(it) => inner.push(it.item_ty().id()),
        TypeInfo::Enum(it) => {
            for variant in it.iter() {
                match variant {
                    bevy::reflect::enums::VariantInfo::Struct(it) => {
                        inner.extend(it.iter().map(|field| field.type_id()))
                    }
                    bevy::reflect::enums::VariantInfo::Tuple(it) => {
                        inner.extend(it.iter().map(|field| field.type_id()))
                    }
                    bevy::reflect::enums::VariantInfo::Unit(_) => {}
                }
            }
        }
        _ => {}
    }
    for id in inner {
        let Some(registration) = registry.get(id) else { continue };
        let path = registration.type_info().type_path();
        let is_struct = matches!(registration.type_info(), TypeInfo::Struct(_));
        if path.starts_with("bevy_surgery::") && is_struct && registration.data::<ReflectDefault>().is_none() {
            found.insert(path);
        }
        parts(registration.type_info(), registry, found);
    }
}

#[test]
fn parts_of_components_have_defaults_too() {
    let app = TestApp::cpu();
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let mut found = BTreeSet::new();
    for path in SceneComponents::authored_of_crate() {
        let registration = registry.get_with_type_path(path).expect("it is registered");
        parts(registration.type_info(), &registry, &mut found);
    }
    assert_eq!(found, BTreeSet::new(), "these need #[reflect(Default)]");
}

#[test]
fn every_component_is_either_saved_or_derived() {
    let app = TestApp::cpu();
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let saved: BTreeSet<&str> = SceneComponents::authored_of_crate().into_iter().collect();
    let derived: BTreeSet<&str> = SceneComponents::derived_of_crate().into_iter().collect();
    assert_eq!(saved.intersection(&derived).count(), 0);
    let components =
        registry.iter().filter(|it| it.data::<ReflectComponent>().is_some() && it.data::<ReflectResource>().is_none());
    let own: Vec<&str> =
        components.map(|it| it.type_info().type_path()).filter(|path| path.starts_with("bevy_surgery::")).collect();
    assert!(own.len() > 40, "only {} components are known", own.len());
    let unlisted: BTreeSet<&&str> =
        own.iter().filter(|path| !saved.contains(*path) && !derived.contains(*path)).collect();
    assert_eq!(unlisted, BTreeSet::new(), "say in src/scenes/components.rs what they are");
}

/// Choices of components that a default does not make.
#[test]
fn every_choice_comes_back() {
    use bevy_surgery::organ::procedural::ProceduralLiver;
    let mut app = TestApp::cpu();
    let mut tools = Vec::new();
    let kinds = [
        ToolKind::Probe,
        ToolKind::Grasper(Jaws { friction: 0.4, ..default() }),
        ToolKind::BiopsyNeedle(Wound::default()),
        ToolKind::CauteryHook(Electrodes { coagulation: Cautery::coagulate(20.0), ..default() }),
        ToolKind::Drill(DrillHead { flutes: 5, ..default() }),
        ToolKind::SuctionIrrigator,
        ToolKind::Scope,
    ];
    for kind in kinds {
        let tool = Tool::new(kind).in_hand(ToolHand::Left);
        tools.push((app.world_mut().spawn(tool.clone()).id(), tool));
    }
    let sources = [
        OrganSource::Liver(ProceduralLiver { seed: 9, ..default() }),
        OrganSource::Ellipsoid { semi_axes_m: Vec3::new(0.1, 0.2, 0.3), subdivisions: 7 },
        OrganSource::File("organs/liver.obj".into()),
    ];
    let options = OrganOptions { chart: ChartKind::OwnUvs, ..OrganOptions::default().with_largest_extent_m(0.2) };
    let organs = sources.map(|source| LoadOrgan { source, options: options.clone() });
    let organs = organs.map(|organ| (app.world_mut().spawn(organ.clone()).id(), organ));
    let frames = KeyFrames {
        frames: vec![KeyFrame { time_s: 0.5, translations: vec![Vec3::X, Vec3::NEG_Y] }, KeyFrame::default()],
        interpolation: KeyInterpolation::Linear,
        loops: true,
    };
    let animation = LatticeAnimation::new(LatticeMotion::KeyFrames(frames));
    let skin = Skin { tiles: TileSource::Painted(["a", "b", "c", "d"].map(String::from)), ..Skin::spleen() };
    let vein = Bleeder { clotting_s: f32::INFINITY, control: BleedingControl::Packed, ..default() };
    let look = VolumeLook { clip_planes: vec![Vec4::W, Vec4::X], method: VolumeMethod::Slices, ..default() };
    let others = (animation.clone(), skin.clone(), vein.clone(), look.clone(), PoolLevel::Fixed(0.002));
    let others = app.world_mut().spawn((others, SoftVolume { tissue: Some(ElasticTissue::FAT), ..default() })).id();
    let (_, fresh, map) = saved_and_loaded(&app);
    let world = fresh.world();
    for (entity, tool) in tools {
        assert_eq!(world.get::<Tool>(map[&entity]), Some(&tool));
    }
    for (entity, organ) in organs {
        assert_eq!(world.get::<LoadOrgan>(map[&entity]), Some(&organ));
    }
    let others = map[&others];
    assert_eq!(world.get::<LatticeAnimation>(others), Some(&animation));
    assert_eq!(world.get::<Skin>(others), Some(&skin));
    assert_eq!(world.get::<Bleeder>(others), Some(&vein));
    assert_eq!(world.get::<VolumeLook>(others), Some(&look));
    assert_eq!(world.get::<PoolLevel>(others), Some(&PoolLevel::Fixed(0.002)));
    assert_eq!(world.get::<SoftVolume>(others).and_then(|soft| soft.tissue), Some(ElasticTissue::FAT));
}
