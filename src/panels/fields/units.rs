//! Units, from the names of fields: they end in them.

/// What a number measures, and how it is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// As it is written behind the number; empty for plain numbers.
    pub symbol: &'static str,
    /// What the number is multiplied by to be shown.
    pub shown_per_stored: f64,
}

/// Ends of names, the longest first among those that end alike, and how such numbers are shown: lengths of a surgical scene in
/// millimetres, angles in degrees.
const UNITS: &[(&str, &str, f64)] = &[
    ("_ml_per_s_mm3", "ml/(s·mm³)", 1.0),
    ("_kg_per_m3", "kg/m³", 1.0),
    ("_n_s_per_m", "N·s/m", 1.0),
    ("_m_per_s2", "m/s²", 1.0),
    ("_n_per_m", "N/m", 1.0),
    ("_m_per_s", "m/s", 1.0),
    ("_per_mm2", "1/mm²", 1.0),
    ("_per_s2", "1/s²", 1.0),
    ("_per_m3", "1/m³", 1.0),
    ("_per_m", "1/m", 1.0),
    ("_per_s", "1/s", 1.0),
    ("_ml_s", "ml/s", 1.0),
    ("_m_s2", "m/s²", 1.0),
    ("_m2_s", "m²/s", 1.0),
    ("_m_s", "m/s", 1.0),
    ("_mmhg", "mmHg", 1.0),
    ("_mm3", "mm³", 1.0),
    ("_rpm", "1/min", 1.0),
    ("_rad", "°", 180.0 / std::f64::consts::PI),
    ("_deg", "°", 1.0),
    ("_lux", "lx", 1.0),
    ("_hz", "Hz", 1.0),
    ("_ml", "ml", 1.0),
    ("_mm", "mm", 1.0),
    ("_pa", "Pa", 1.0),
    ("_kg", "kg", 1.0),
    ("_cd", "cd", 1.0),
    ("_px", "px", 1.0),
    ("_m3", "ml", 1e6),
    ("_s", "s", 1.0),
    ("_m", "mm", 1e3),
    ("_n", "N", 1.0),
    ("_j", "J", 1.0),
    ("_k", "K", 1.0),
    ("_w", "W", 1.0),
    ("_voxels", "voxels", 1.0),
];

/// Angles whose names say no unit, for they stand beside each other in papers.
const PLAIN_ANGLES: &[&str] = &["dry_roughness", "wet_roughness", "grain_tilt"];

impl Unit {
    /// Of a number without a unit: a share, a count, a factor.
    pub const PLAIN: Self = Self { symbol: "", shown_per_stored: 1.0 };

    /// The unit of a field.
    pub fn of_field(name: &str) -> Self {
        let name = match name {
            // Bevy's own: metres.
            "translation" => "_m",
            name if PLAIN_ANGLES.contains(&name) => "_rad",
            name => name,
        };
        let found = UNITS.iter().find(|(end, ..)| name.ends_with(end));
        found.map_or(Self::PLAIN, |&(_, symbol, shown_per_stored)| Self { symbol, shown_per_stored })
    }
}

/// The name of a field without its unit, as people write it: `ring_radius_m` is "Ring radius".
pub fn label_of_field(name: &str) -> String {
    let end = UNITS.iter().find(|(end, ..)| name.ends_with(end)).map_or("", |(end, ..)| end);
    let plain = name.strip_suffix(end).filter(|plain| !plain.is_empty()).unwrap_or(name);
    let plain = plain.strip_prefix("is_").or(plain.strip_prefix("has_")).unwrap_or(plain);
    sentence(&plain.replace('_', " "))
}

/// The name of a type or variant as people write it: `ScopeLight` is "Scope light", `CtVolume` "Ct volume".
pub fn label_of_type(name: &str) -> String {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
    }
    sentence(&words)
}

fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
