//! Every WGSL file composes and validates, and Rust lays its structs out as naga does.

use bevy::asset::LoadState;
use bevy::prelude::*;
use bevy::render::render_resource::encase::private::ShaderType as _;
use bevy::render::view::ViewUniform;
use bevy_surgery::highlights::{HighlightRing, HighlightsUniform};
use bevy_surgery::organ::render::{OrganUniform, PrimaryVertex, corner_vertex_layout};
use bevy_surgery::pool::render::PoolUniform;
use bevy_surgery::pool::render::flow::{FlowSource, FlowUniform};
use bevy_surgery::render::{LightUniform, OrganLights, SHADERS};
use bevy_surgery::skin::SkinUniform;
use bevy_surgery::testing::TestApp;
use bevy_surgery::view::{ScopeMaskUniform, ToolCasterUniform, ToolShadowUniform};
use bevy_surgery::volume::{AlignedUniform, DeformUniform, PatchFramesTexel, PatchRectTexel, VolumeUniform};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga_oil::compose::{ComposableModuleDescriptor, Composer, NagaModuleDescriptor, ShaderDefValue};
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

/// All WGSL files below `shaders/`, as paths relative to it.
fn files_on_disk() -> Vec<String> {
    fn walk(folder: &Path, found: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).expect("a folder of the crate") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                walk(&path, found);
            } else if path.extension().is_some_and(|extension| extension == "wgsl") {
                let root = concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/");
                found.push(path.to_string_lossy().trim_start_matches(root).to_string());
            }
        }
    }
    let mut found = Vec::new();
    walk(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders")), &mut found);
    found.sort();
    found
}

/// Bevy's own shader libraries, which ours import: import path and source.
fn bevy_libraries() -> Vec<(String, String)> {
    let mut app = TestApp::gpu(16, 16);
    app.spawn_camera(Transform::default());
    app.warm_up();
    let shaders = app.world().resource::<Assets<Shader>>();
    let libraries = shaders.iter().map(|(_, shader)| (shader.import_path.module_name().to_string(), shader));
    let mut found: Vec<(String, String)> = libraries
        .filter(|(name, _)| name.starts_with("bevy_") && !name.starts_with("bevy_surgery"))
        .map(|(name, shader)| (name, shader.source.as_str().to_string()))
        .collect();
    found.sort();
    found
}

/// A composer that knows Bevy's libraries and ours.
fn composer() -> Composer {
    let mut composer = Composer::default().with_capabilities(Capabilities::all());
    let mut waiting = bevy_libraries();
    assert!(!waiting.is_empty(), "Bevy's own libraries were not found");
    waiting.extend(SHADERS.iter().filter(|s| s.is_library).map(|s| (s.path.to_string(), s.source.to_string())));
    // In whatever order they need one another; what never fits (a part of Bevy that needs a feature) is left out.
    loop {
        let before = waiting.len();
        waiting.retain(|(path, source)| {
            let descriptor =
                ComposableModuleDescriptor { source, file_path: path, shader_defs: definitions(), ..default() };
            composer.add_composable_module(descriptor).is_err()
        });
        if waiting.len() == before {
            break;
        }
    }
    let ours: Vec<_> = waiting.iter().filter(|(path, _)| SHADERS.iter().any(|shader| shader.path == path)).collect();
    assert!(
        ours.is_empty(),
        "libraries that do not compose: {:?}",
        ours.iter().map(|(path, _)| path).collect::<Vec<_>>()
    );
    composer
}

fn definitions() -> HashMap<String, ShaderDefValue> {
    let binding = |name: &str, place| (name.to_string(), ShaderDefValue::UInt(place));
    HashMap::from([
        binding("TONEMAPPING_LUT_TEXTURE_BINDING_INDEX", 1),
        binding("TONEMAPPING_LUT_SAMPLER_BINDING_INDEX", 2),
    ])
}

fn compose(composer: &mut Composer, path: &str, source: &str) -> Result<naga::Module, String> {
    compose_with(composer, path, source, &[])
}

fn compose_with(composer: &mut Composer, path: &str, source: &str, more: &[&str]) -> Result<naga::Module, String> {
    let mut shader_defs = definitions();
    shader_defs.extend(more.iter().map(|name| (name.to_string(), ShaderDefValue::Bool(true))));
    let descriptor = NagaModuleDescriptor { source, file_path: path, shader_defs, ..default() };
    let module = composer.make_naga_module(descriptor).map_err(|error| error.emit_to_string(composer))?;
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
    validator.validate(&module).map_err(|error| error.emit_to_string(source))?;
    Ok(module)
}

#[test]
fn every_shader_is_embedded() {
    let on_disk = files_on_disk();
    assert!(!on_disk.is_empty(), "no WGSL file was found: this test looks in the wrong place");
    let mut embedded: Vec<&str> = SHADERS.iter().map(|shader| shader.path).collect();
    embedded.sort_unstable();
    assert_eq!(embedded, on_disk);
    for shader in SHADERS {
        assert_eq!(shader.source.contains("#define_import_path"), shader.is_library, "{}", shader.path);
    }
}

#[test]
fn every_shader_composes_and_validates() {
    let mut composer = composer();
    for shader in SHADERS {
        if let Err(reason) = compose(&mut composer, shader.path, shader.source) {
            panic!("{}: {reason}", shader.path);
        }
        // As on a camera without HDR.
        let tonemapping = ["TONEMAP_IN_SHADER", "TONEMAP_METHOD_AGX"];
        if let Err(reason) = compose_with(&mut composer, shader.path, shader.source, &tonemapping) {
            panic!("{} with tonemapping: {reason}", shader.path);
        }
        // Tiles of a pool without walls, and what is read back of it.
        if let Err(reason) = compose_with(&mut composer, shader.path, shader.source, &["DEEP", "READINGS"]) {
            panic!("{} with the pool's definitions: {reason}", shader.path);
        }
        if let Err(reason) = compose_with(&mut composer, shader.path, shader.source, &["MULTISAMPLED"]) {
            panic!("{} with several samples: {reason}", shader.path);
        }
        // Pools that foam, under an environment map.
        if let Err(reason) = compose_with(&mut composer, shader.path, shader.source, &["FOAM", "ENVIRONMENT_MAP"]) {
            panic!("{} with foam and a map: {reason}", shader.path);
        }
        // Volumes with colours of their own, and what of them writes depth.
        if let Err(reason) = compose_with(&mut composer, shader.path, shader.source, &["OWN_COLOURS", "SOLID_PART"]) {
            panic!("{} with colours of the voxels: {reason}", shader.path);
        }
        // Volumes that a lattice deforms, under light.
        if let Err(reason) = compose_with(&mut composer, shader.path, shader.source, &["DEFORMED", "LIT"]) {
            panic!("{} deformed: {reason}", shader.path);
        }
        // Slices that are cut and lit; the scene before them.
        for more in [&["CLIPPED", "NORMALS", "SCENE"][..], &["SCENE", "MULTISAMPLED"][..]] {
            if let Err(reason) = compose_with(&mut composer, shader.path, shader.source, more) {
                panic!("{} with {more:?}: {reason}", shader.path);
            }
        }
    }
    let wrong = "@fragment fn fragment() -> @location(0) vec4<f32> { return 1.0; }";
    assert!(compose(&mut composer, "wrong.wgsl", wrong).is_err(), "a wrong shader must not pass");
}

#[test]
fn every_shader_loads_in_an_app() {
    let mut app = TestApp::gpu(16, 16);
    app.spawn_camera(Transform::default());
    let assets = app.world().resource::<AssetServer>().clone();
    let handles: Vec<(_, Handle<Shader>)> =
        SHADERS.iter().map(|s| (s.path, assets.load(bevy_surgery::render::shader_path(s.path)))).collect();
    app.idle_until("shaders", |_| !handles.iter().any(|(_, h)| matches!(assets.load_state(h), LoadState::Loading)));
    for (path, handle) in handles {
        assert!(matches!(assets.load_state(&handle), LoadState::Loaded), "{path}: {:?}", assets.load_state(&handle));
    }
}

/// Size and member offsets of a struct in a composed module. Names of imported structs are decorated.
fn layout_in(module: &naga::Module, name: &str) -> (u32, Vec<(String, u32)>) {
    let (_, found) = module
        .types
        .iter()
        .find(|(_, ty)| ty.name.as_deref().is_some_and(|n| n == name || n.starts_with(&format!("{name}X_naga_oil"))))
        .unwrap_or_else(|| panic!("{name} is in no shader"));
    let naga::TypeInner::Struct { members, span } = &found.inner else { panic!("{name} is no struct") };
    let offsets = members.iter().map(|member| (member.name.clone().unwrap_or_default(), member.offset)).collect();
    (*span, offsets)
}

macro_rules! assert_layout {
    ($module:expr, $name:literal, $type:ty) => {{
        let (size, offsets) = layout_in($module, $name);
        let rust: Vec<u32> = <$type>::METADATA.extra.offsets.iter().map(|offset| *offset as u32).collect();
        let wgsl: Vec<u32> = offsets.iter().map(|(_, offset)| *offset).collect();
        assert_eq!(rust, wgsl, "offsets of {}: {offsets:?}", $name);
        assert_eq!(<$type>::METADATA.min_size().get() as u32, size, "size of {}", $name);
    }};
}

#[test]
fn rust_and_wgsl_agree_on_every_struct() {
    let mut composer = composer();
    let source = |path: &str| SHADERS.iter().find(|shader| shader.path == path).expect("a listed shader").source;
    let skin = compose(&mut composer, "skin/skin.wgsl", source("skin/skin.wgsl")).expect("composes");
    let mask = compose(&mut composer, "view/mask.wgsl", source("view/mask.wgsl")).expect("composes");
    assert_layout!(&skin, "View", ViewUniform);
    assert_layout!(&skin, "LightUniform", LightUniform);
    assert_layout!(&skin, "OrganLights", OrganLights);
    assert_layout!(&skin, "OrganUniform", OrganUniform);
    assert_layout!(&skin, "SkinUniform", SkinUniform);
    let highlights = compose(&mut composer, "highlights/highlights.wgsl", source("highlights/highlights.wgsl"));
    let highlights = highlights.expect("composes");
    assert_layout!(&highlights, "HighlightRing", HighlightRing);
    assert_layout!(&highlights, "HighlightsUniform", HighlightsUniform);
    assert_layout!(&mask, "ScopeMaskUniform", ScopeMaskUniform);
    let map = compose(&mut composer, "view/tool_shadow_map.wgsl", source("view/tool_shadow_map.wgsl"));
    assert_layout!(&map.expect("composes"), "ToolCasterUniform", ToolCasterUniform);
    let shadows = compose(&mut composer, "view/tool_shadows.wgsl", source("view/tool_shadows.wgsl"));
    assert_layout!(&shadows.expect("composes"), "ToolShadowUniform", ToolShadowUniform);
    let march = compose(&mut composer, "volume/march.wgsl", source("volume/march.wgsl")).expect("composes");
    assert_layout!(&march, "VolumeUniform", VolumeUniform);
    let deformed = compose_with(&mut composer, "volume/march.wgsl", source("volume/march.wgsl"), &["DEFORMED"]);
    assert_layout!(&deformed.expect("composes"), "DeformUniform", DeformUniform);
    let aligned = compose(&mut composer, "volume/aligned.wgsl", source("volume/aligned.wgsl")).expect("composes");
    assert_layout!(&aligned, "AlignedUniform", AlignedUniform);
    assert_layout!(&aligned, "PatchFrames", PatchFramesTexel);
    assert_layout!(&aligned, "PatchRect", PatchRectTexel);
    let pool = compose(&mut composer, "pool/composite.wgsl", source("pool/composite.wgsl")).expect("composes");
    assert_layout!(&pool, "PoolUniform", PoolUniform);
    let act = compose(&mut composer, "pool/act.wgsl", source("pool/act.wgsl")).expect("composes");
    assert_layout!(&act, "FlowUniform", FlowUniform);
    assert_layout!(&act, "FlowSource", FlowSource);
    let (size, offsets) = layout_in(&skin, "PrimaryVertex");
    assert_eq!(size as usize, size_of::<PrimaryVertex>());
    assert_eq!(offsets[0].1 as usize, std::mem::offset_of!(PrimaryVertex, position_m));
    assert_eq!(offsets[1].1 as usize, std::mem::offset_of!(PrimaryVertex, normal));
}

/// Names of the structs that a module's buffers hold, without what composing adds to them.
fn buffer_structs(module: &naga::Module) -> BTreeSet<String> {
    fn collect(module: &naga::Module, ty: naga::Handle<naga::Type>, found: &mut BTreeSet<String>) {
        let ty = &module.types[ty];
        match &ty.inner {
            naga::TypeInner::Struct { members, .. } => {
                let name = ty.name.clone().unwrap_or_default();
                found.insert(name.split("X_naga_oil").next().unwrap_or_default().to_string());
                members.iter().for_each(|member| collect(module, member.ty, found));
            }
            naga::TypeInner::Array { base, .. } => collect(module, *base, found),
            _ => {}
        }
    }
    let mut found = BTreeSet::new();
    for (_, variable) in module.global_variables.iter() {
        if matches!(variable.space, naga::AddressSpace::Uniform | naga::AddressSpace::Storage { .. }) {
            collect(module, variable.ty, &mut found);
        }
    }
    found
}

#[test]
fn no_struct_escapes_the_comparison() {
    let mut composer = composer();
    let mut found = BTreeSet::new();
    for shader in SHADERS.iter().filter(|shader| !shader.is_library) {
        found.extend(buffer_structs(&compose(&mut composer, shader.path, shader.source).expect("composes")));
        let deformed = compose_with(&mut composer, shader.path, shader.source, &["DEFORMED", "LIT"]);
        found.extend(buffer_structs(&deformed.expect("composes")));
    }
    // `ColorGrading` is a part of Bevy's `View`, whose size is compared.
    let compared = [
        "AlignedUniform",
        "ColorGrading",
        "DeformUniform",
        "FlowSource",
        "FlowUniform",
        "HighlightRing",
        "HighlightsUniform",
        "LightUniform",
        "OrganLights",
        "OrganUniform",
        "PatchFrames",
        "PatchRect",
        "PoolUniform",
        "PrimaryVertex",
        "ScopeMaskUniform",
        "SkinUniform",
        "ToolCasterUniform",
        "ToolShadowUniform",
        "VolumeUniform",
    ];
    let compared: BTreeSet<String> = compared.into_iter().chain(["View"]).map(String::from).collect();
    assert_eq!(found, compared, "add new structs to `rust_and_wgsl_agree_on_every_struct` and to this list");
}

#[test]
fn the_vertex_shader_reads_what_the_buffer_holds() {
    let mut composer = composer();
    let shader = SHADERS.iter().find(|shader| shader.path == "skin/skin.wgsl").expect("a listed shader");
    let module = compose(&mut composer, shader.path, shader.source).expect("composes");
    let (_, corner) = module
        .types
        .iter()
        .find(|(_, ty)| ty.name.as_deref().is_some_and(|name| name.starts_with("CornerVertex")))
        .expect("the vertex struct");
    let naga::TypeInner::Struct { members, .. } = &corner.inner else { panic!("no struct") };
    let layout = corner_vertex_layout();
    assert_eq!(layout.array_stride as usize, size_of::<bevy_surgery::organ::render::CornerVertex>());
    assert_eq!(members.len(), layout.attributes.len());
    for (member, attribute) in members.iter().zip(&layout.attributes) {
        let Some(naga::Binding::Location { location, .. }) = member.binding else { panic!("no location") };
        assert_eq!(location, attribute.shader_location);
        let bytes = module.types[member.ty].inner.size(module.to_ctx());
        assert_eq!(u64::from(bytes), attribute.format.size(), "{:?}", member.name);
    }
}
