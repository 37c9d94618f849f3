//! Tonemapping on cameras without HDR, which Bevy leaves to whoever shades.

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::shader::ShaderDefVal;

/// Where the lookup texture and its sampler lie in group 0 of an organ layer's pipeline.
pub(crate) const LUT_BINDINGS: [u32; 2] = [1, 2];

/// Definitions that make a layer's shader tonemap as Bevy's materials do on such a camera.
pub(crate) fn tonemapping_definitions(tonemapping: Tonemapping) -> Vec<ShaderDefVal> {
    let method = match tonemapping {
        Tonemapping::None => return Vec::new(),
        Tonemapping::Reinhard => "TONEMAP_METHOD_REINHARD",
        Tonemapping::ReinhardLuminance => "TONEMAP_METHOD_REINHARD_LUMINANCE",
        Tonemapping::AcesFitted => "TONEMAP_METHOD_ACES_FITTED",
        Tonemapping::AgX => "TONEMAP_METHOD_AGX",
        Tonemapping::SomewhatBoringDisplayTransform => "TONEMAP_METHOD_SOMEWHAT_BORING_DISPLAY_TRANSFORM",
        Tonemapping::TonyMcMapface => "TONEMAP_METHOD_TONY_MC_MAPFACE",
        Tonemapping::BlenderFilmic => "TONEMAP_METHOD_BLENDER_FILMIC",
        Tonemapping::KhronosPbrNeutral => "TONEMAP_METHOD_PBR_NEUTRAL",
    };
    let [texture, sampler] = LUT_BINDINGS;
    vec![
        "TONEMAP_IN_SHADER".into(),
        method.into(),
        ShaderDefVal::UInt("TONEMAPPING_LUT_TEXTURE_BINDING_INDEX".into(), texture),
        ShaderDefVal::UInt("TONEMAPPING_LUT_SAMPLER_BINDING_INDEX".into(), sampler),
    ]
}
