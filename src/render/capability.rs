//! Is there anything to draw with?

use wgpu::{Backends, DeviceType, Instance, InstanceDescriptor};

/// A graphics adapter that the machine offers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GraphicsAdapter {
    /// The driver's name for it.
    pub name: String,
    /// Vulkan, Metal, Dx12 or Gl.
    pub backend: String,
    /// Whether it is a processor that pretends to be a graphics card (llvmpipe, SwiftShader, WARP).
    pub is_software: bool,
}

/// The adapters that Bevy could draw with, real cards first; `WGPU_BACKEND` chooses among back ends as it does for
/// Bevy. Empty where there is none: starting a render app there would
/// panic inside Bevy, so ask first and say so.
pub fn graphics_adapters() -> Vec<GraphicsAdapter> {
    let backends = Backends::from_env().unwrap_or(Backends::PRIMARY);
    let instance = Instance::new(InstanceDescriptor { backends, ..InstanceDescriptor::new_without_display_handle() });
    let mut adapters: Vec<_> = bevy::tasks::block_on(instance.enumerate_adapters(backends))
        .iter()
        .map(wgpu::Adapter::get_info)
        .map(|info| GraphicsAdapter {
            name: info.name,
            backend: info.backend.to_string(),
            is_software: info.device_type == DeviceType::Cpu,
        })
        .collect();
    adapters.sort_by_key(|adapter| adapter.is_software);
    adapters
}
