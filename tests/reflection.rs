//! Every public data type is reflected and registered, so that inspectors, scenes and remote tools see it.

use bevy::prelude::*;
use bevy_surgery::testing::TestApp;
use std::path::Path;

/// Public types that are code rather than data.
const NOT_DATA: &[(&str, &str)] = &[
    ("Plugin", "a plugin"),
    ("Plugins", "a group of plugins"),
    ("Loader", "an asset loader"),
    ("OrganPasses", "a system set"),
    ("ToolShadowPasses", "a system set"),
    ("PrepareOrgans", "a system set"),
    ("ShapeOrgans", "a system set"),
    ("VolumePasses", "a system set"),
    ("PoolPasses", "a system set"),
    ("DrillVolumes", "a system set"),
    ("FlowPools", "a system set"),
    ("FollowLattices", "a system set"),
    ("StepBodies", "a system set"),
    ("PrepareCuts", "a system set"),
    ("SenseDevices", "a system set"),
    ("TouchTools", "a system set"),
    ("Devices", "keeps a thread"),
    ("ServoSession", "holds a device"),
    ("DeformBodies", "a system set"),
    ("LatticeInverse", "borrows"),
    ("OrganPicking", "a system parameter"),
    ("VolumePicking", "a system parameter"),
    ("MarchScene", "borrows"),
    ("AlignedField", "borrows"),
    ("StepContext", "borrows"),
    ("Ageing", "an argument"),
    ("Motion", "borrows"),
    ("Surface", "borrows"),
    ("Stroke", "borrows"),
    ("ReactionKinds", "holds code"),
    ("Device", "a driver"),
    ("DeviceHandle", "a mailbox"),
    ("DeviceManager", "keeps a thread"),
    ("Hand", "a mailbox"),
    ("Voice", "makes samples"),
    ("VoiceDials", "a mailbox"),
    ("VoiceSource", "holds a voice"),
    ("HandBackend", "a driver"),
    ("HaplyBackend", "a driver"),
    ("NoBackend", "a driver"),
    ("SimulatedBackend", "a driver"),
    ("ReplayBackend", "a driver"),
    ("OpenHapticsBackend", "a driver"),
    ("ForceDimensionBackend", "a driver"),
    ("SpaceMouseBackend", "a driver"),
    ("RecorderHandle", "a mailbox"),
    ("ReplayHandle", "a mailbox"),
    ("HidTransport", "a driver"),
    ("TestApp", "the test harness"),
    ("GpuTarget", "the test harness"),
    ("GraphicsAdapter", "an answer of the driver, not of the world"),
    ("EmbeddedShader", "a constant of the crate"),
    ("SkinTileLibrary", "holds running tasks"),
    ("ScenarioSystems", "a system set"),
    ("ScenarioRun", "writes a file"),
    ("Checkpoint", "a copy of a world"),
    ("BeginMessages", "a system set"),
    ("LogWriter", "writes a file"),
    ("Judge", "follows a run"),
    ("ScriptedHand", "holds a generator of random numbers"),
    ("ReadyScenario", "a constant of the crate"),
    ("Template", "makes a component of a scene"),
    ("SceneComponents", "a list of types"),
    ("Checkpoint", "a copy of a world"),
    ("BeginMessages", "a system set"),
];

/// Folders behind a feature, whose plugin an app adds itself.
const ADDED_BY_APPS: &[&str] = &["panels/"];

/// Folders whose types live in the render world, which has no registry.
const RENDER_WORLD: &[&str] = &[
    "organ/render/",
    "render/lights.rs",
    "render/uploads.rs",
    "highlights/render/",
    "pool/render/flow/pass.rs",
    "pool/render/flow/uniform.rs",
    "skin/render/prepare.rs",
    "view/tool_shadows/map.rs",
    "view/tool_shadows/prepare.rs",
    "volume/render/",
    "pool/render/",
];

/// Folders of models that know no ECS: what passes between threads, borrows, or holds devices. What they reflect is registered.
const NO_ECS: &[&str] = &[
    "haptics/device/",
    "haptics/exchange.rs",
    "haptics/force/",
    "haptics/safety/",
    "haptics/servo/",
    "haptics/stats.rs",
    "scenario/metrics/",
    "scenario/report/",
];

/// Public types of the sources: name, file, and whether `Reflect` is derived.
fn public_types(folder: &Path, found: &mut Vec<(String, String, bool)>) {
    for entry in std::fs::read_dir(folder).expect("a folder of the crate") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            public_types(&path, found);
            continue;
        }
        let text = std::fs::read_to_string(&path).expect("a source file");
        let file = path.to_string_lossy().trim_start_matches(concat!(env!("CARGO_MANIFEST_DIR"), "/src/")).to_string();
        let mut attributes = String::new();
        for line in text.lines() {
            let declared = line.strip_prefix("pub struct ").or_else(|| line.strip_prefix("pub enum "));
            if let Some(rest) = declared {
                let name: String = rest.chars().take_while(|c| c.is_alphanumeric()).collect();
                found.push((name, file.clone(), attributes.contains("Reflect")));
            }
            let continues = line.starts_with("#[") || line.starts_with("///") || line.starts_with(' ') || line == ")]";
            if line.starts_with("#[") || (continues && !line.starts_with("///")) {
                attributes += line;
            } else if !continues {
                attributes.clear();
            }
        }
    }
}

#[test]
fn public_types_are_reflected_and_registered() {
    let mut types = Vec::new();
    public_types(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src")), &mut types);
    assert!(types.len() > 60, "only {} types were found: this test reads the wrong files", types.len());
    let app = TestApp::gpu(16, 16);
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let mut missing = Vec::new();
    for (name, file, is_reflected) in types {
        let is_code = NOT_DATA.iter().any(|(ending, _)| name.ends_with(ending));
        // Extracted and uniform types are copies of main-world data for one frame.
        let is_copy = RENDER_WORLD.iter().any(|place| file.starts_with(place))
            || ["ScopeMaskUniform", "MaskPipelineId"].contains(&name.as_str());
        let is_model = !is_reflected && NO_ECS.iter().any(|place| file.starts_with(place));
        let is_added = ADDED_BY_APPS.iter().any(|place| file.starts_with(place));
        if is_code || is_copy || is_model || is_added {
            continue;
        }
        if !is_reflected || registry.get_with_short_type_path(&name).is_none() {
            missing.push(format!("{name} ({file}): {}", if is_reflected { "not registered" } else { "not reflected" }));
        }
    }
    assert_eq!(missing, Vec::<String>::new());
}
