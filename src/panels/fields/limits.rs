//! In which range a field makes sense: the bounds that its documentation names, and how a control moves through it.

/// Bounds of a number as it is stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Least.
    pub least: f64,
    /// Greatest.
    pub greatest: f64,
    /// Whether it spans several powers of ten.
    pub is_logarithmic: bool,
}

const fn linear(least: f64, greatest: f64) -> Limits {
    Limits { least, greatest, is_logarithmic: false }
}

const fn powers(least: f64, greatest: f64) -> Limits {
    Limits { least, greatest, is_logarithmic: true }
}

/// Type, field and bounds. Fields that are not here take any number; what makes no sense is bounded by the models themselves.
pub const LIMITS: &[(&str, &str, Limits)] = &[
    ("Skin", "mottle", linear(0.0, 1.0)),
    ("Skin", "mottle_size_m", powers(1e-3, 0.2)),
    ("Skin", "scatter", linear(0.0, 1.0)),
    ("Skin", "sheen", linear(0.0, 5.0)),
    ("Skin", "sheen_roughness", linear(0.05, 1.0)),
    ("Skin", "relief_m", linear(-2e-3, 2e-3)),
    ("Reactions", "map_width_px", linear(64.0, 8192.0)),
    ("Reactions", "max_sprites", linear(1.0, 100_000.0)),
    ("Highlights", "strength", linear(0.0, 10.0)),
    ("Highlights", "dry_roughness", powers(0.002, 0.7)),
    ("Highlights", "wet_roughness", powers(0.002, 0.7)),
    ("Highlights", "reflectance", linear(0.0, 1.0)),
    ("Highlights", "film_relief_m", linear(0.0, 0.01)),
    ("Highlights", "grain_tilt", linear(0.0, 0.5)),
    ("Highlights", "grain_size_m", powers(1e-5, 0.1)),
    ("VolumeLook", "step_voxels", linear(0.25, 4.0)),
    ("WetShading", "passes", linear(0.0, 16.0)),
    ("WetShading", "edge_voxels", linear(0.0, 20.0)),
    ("WetShading", "shine", linear(0.0, 5.0)),
    ("WetShading", "shine_exponent", powers(1.0, 1000.0)),
    ("TransferFunction", "reference_length_m", powers(1e-5, 0.1)),
    ("WatchCritical", "band_mm", linear(0.01, 20.0)),
    ("PhantomOptions", "size", linear(32.0, 512.0)),
    ("PhantomOptions", "pneumatization", linear(0.0, 1.0)),
    ("SoftVolume", "level", linear(0.0, 6.0)),
    ("SoftVolume", "held_share", linear(0.0, 1.0)),
    ("ElasticTissue", "youngs_modulus_pa", powers(1e2, 1e8)),
    ("ElasticTissue", "poisson_ratio", linear(0.0, 0.499)),
    ("ElasticTissue", "density_kg_per_m3", linear(100.0, 3000.0)),
    ("ElasticTissue", "tears_at_stretch", linear(1.0, 5.0)),
    ("Pool", "cell_m", powers(1e-5, 5e-3)),
    ("Pool", "size", linear(4.0, 2048.0)),
    ("PoolFluid", "hides_from_m", powers(1e-5, 1e-2)),
    ("PoolFluid", "dust_hides", linear(0.0, 1.0)),
    ("SolverSettings", "pressure_iterations", linear(1.0, 500.0)),
    ("SolverSettings", "diffusion_iterations", linear(1.0, 100.0)),
    ("PoolLook", "wave_height", linear(0.0, 100.0)),
    ("PoolLook", "water_index", linear(1.0, 3.0)),
    ("PoolLook", "blood_index", linear(1.0, 3.0)),
    ("PoolLook", "environment_strength", linear(0.0, 10.0)),
    ("PoolLook", "room", linear(0.0, 10.0)),
    ("Bleeder", "open_share", linear(0.0, 1.0)),
    ("SuctionIrrigator", "irrigation_ml_s", linear(0.0, 20.0)),
    ("SuctionIrrigator", "suction_ml_s", linear(0.0, 200.0)),
    ("ToolRig", "scale", powers(0.01, 10.0)),
    ("ToolRig", "force_scale", powers(0.01, 10.0)),
    ("DrillHead", "full_speed_rpm", linear(0.0, 100_000.0)),
    ("Endoscope", "field_of_view_rad", linear(0.1, 2.6)),
    ("ScopeLight", "intensity_cd", powers(1.0, 10_000.0)),
    ("ScopeLight", "ring_radius_m", linear(0.0, 0.05)),
    ("ScopeLight", "inner_angle_rad", linear(0.0, 1.5)),
    ("ScopeLight", "outer_angle_rad", linear(0.0, 1.5)),
    ("ScopeLight", "ambient_fraction", linear(0.0, 1.0)),
    ("ScopeMask", "radius", linear(0.0, 2.0)),
    ("ScopeMask", "softness", linear(0.0, 0.5)),
    ("Microscope", "working_distance_m", linear(0.01, 1.0)),
    ("Microscope", "field_at_1x_m", linear(0.001, 1.0)),
    ("StereoPair", "interocular_m", linear(0.0, 0.1)),
    ("ToolShadows", "strength", linear(0.0, 1.0)),
    ("ToolShadows", "softness_m", linear(0.0, 0.01)),
    ("ToolShadows", "resolution_px", linear(16.0, 4096.0)),
    ("ToolShadows", "half_angle_rad", linear(0.01, 1.5)),
];

/// The bounds of a field of a type.
pub fn limits(short_type: &str, field: &str) -> Option<Limits> {
    LIMITS.iter().find(|(of, name, _)| (*of, *name) == (short_type, field)).map(|(_, _, limits)| *limits)
}
