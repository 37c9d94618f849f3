//! The service's format. What is missing, unknown or of another type than expected is left out, and the rest is used: versions
//! of the service differ.

use glam::{DQuat, DVec3};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value, json};

/// A frame of the service: what it knows of each device.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Frame {
    #[serde(deserialize_with = "list")]
    pub inverse3: Option<Vec<Arm>>,
    #[serde(deserialize_with = "list")]
    verse_grip: Option<Vec<Grip>>,
    #[serde(deserialize_with = "list")]
    wireless_verse_grip: Option<Vec<Grip>>,
    #[serde(deserialize_with = "list")]
    custom_verse_grip: Option<Vec<Grip>>,
}

/// An Inverse3 or a Minverse.
#[derive(Debug, Deserialize)]
pub(super) struct Arm {
    #[serde(deserialize_with = "id")]
    pub device_id: String,
    #[serde(default)]
    config: Value,
    #[serde(default, deserialize_with = "lenient")]
    pub state: Option<ArmState>,
    #[serde(default, deserialize_with = "lenient")]
    pub status: Option<Status>,
}

#[derive(Debug, Deserialize)]
pub(super) struct ArmState {
    #[serde(default, deserialize_with = "lenient")]
    pub cursor_position: Option<Xyz>,
    #[serde(default, deserialize_with = "lenient")]
    pub cursor_velocity: Option<Xyz>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Status {
    #[serde(default, deserialize_with = "lenient")]
    pub calibrated: Option<bool>,
    #[serde(default, deserialize_with = "lenient")]
    pub power_supply: Option<bool>,
}

/// A handle that knows how it is turned.
#[derive(Debug, Deserialize)]
pub(super) struct Grip {
    #[serde(deserialize_with = "id")]
    pub device_id: String,
    #[serde(default, deserialize_with = "lenient")]
    state: Option<GripState>,
}

#[derive(Debug, Deserialize)]
struct GripState {
    #[serde(default, deserialize_with = "lenient")]
    orientation: Option<Xyzw>,
    #[serde(default)]
    buttons: Value,
    /// Older services know one button.
    #[serde(default)]
    button: Value,
}

#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Clone, Copy, Debug, Deserialize)]
struct Xyzw {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

/// A value if it is of the right type.
fn lenient<'de, D: Deserializer<'de>, T: DeserializeOwned>(deserializer: D) -> Result<Option<T>, D::Error> {
    Ok(serde_json::from_value(Value::deserialize(deserializer)?).ok())
}

/// Those of a list that are of the right type; a single thing is a list of one.
fn list<'de, D: Deserializer<'de>, T: DeserializeOwned>(deserializer: D) -> Result<Option<Vec<T>>, D::Error> {
    let usable = |value| serde_json::from_value(value).ok();
    Ok(match Value::deserialize(deserializer)? {
        Value::Array(values) => Some(values.into_iter().filter_map(usable).collect()),
        value @ Value::Object(_) => Some(usable(value).into_iter().collect()),
        _ => None,
    })
}

/// Ids are words or numbers.
fn id<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    match Value::deserialize(deserializer)? {
        Value::String(id) if !id.is_empty() => Ok(id),
        Value::Number(id) => Ok(id.to_string()),
        other => Err(serde::de::Error::custom(format!("{other} is no id"))),
    }
}

impl Xyz {
    pub fn vector(self) -> DVec3 {
        DVec3::new(self.x, self.y, self.z)
    }
}

impl Frame {
    /// Reads a message.
    pub fn read(text: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(text)
    }

    /// All grips, each once: one may be in two lists.
    pub fn grips(&self) -> Vec<&Grip> {
        let mut grips: Vec<&Grip> = Vec::new();
        let lists = [&self.wireless_verse_grip, &self.verse_grip, &self.custom_verse_grip];
        for grip in lists.into_iter().flatten().flatten() {
            if grips.iter().all(|known| known.device_id != grip.device_id) {
                grips.push(grip);
            }
        }
        grips
    }
}

impl Arm {
    /// Whether it says that it is a Minverse, in words or by its number.
    pub fn is_minverse(&self) -> Option<bool> {
        let places = ["/device_info/device_type", "/device_type", "/type"];
        places.iter().find_map(|place| match self.config.pointer(place)? {
            Value::String(kind) => Some(kind.to_lowercase().contains("minverse")),
            Value::Number(kind) => Some(kind.as_u64() == Some(6)),
            _ => None,
        })
    }
}

impl Grip {
    /// How it is turned, in the service's space.
    pub fn orientation(&self) -> Option<DQuat> {
        let Xyzw { x, y, z, w } = self.state.as_ref()?.orientation?;
        let rotation = DQuat::from_xyzw(x, y, z, w);
        (rotation.is_finite() && rotation.length() > 0.5).then(|| rotation.normalize())
    }

    /// Its buttons: `a` is bit 0, `b` bit 1, and so on.
    pub fn buttons(&self) -> u32 {
        let Some(state) = &self.state else { return 0 };
        let is_pressed =
            |value: &Value| value.as_bool().unwrap_or_else(|| value.as_f64().is_some_and(|held| held != 0.0));
        let mut buttons = u32::from(is_pressed(&state.button));
        for (name, value) in state.buttons.as_object().into_iter().flatten() {
            if let &[letter @ (b'a'..=b'z' | b'A'..=b'Z')] = name.as_bytes() {
                buttons |= u32::from(is_pressed(value)) << (letter.to_ascii_lowercase() - b'a');
            }
        }
        buttons
    }
}

/// What a message asks of a device.
pub(super) struct Order<'a> {
    pub device_id: &'a str,
    /// In the service's space.
    pub force_n: DVec3,
    /// Named workspace to be set, in services that have them.
    pub preset: Option<&'a str>,
}

/// A message to the service.
pub(super) fn message(orders: &[Order], has_vectors: bool, profile: Option<&str>) -> String {
    if orders.is_empty() && profile.is_none() {
        return "{}".into();
    }
    let arms: Vec<Value> = orders.iter().map(|order| arm(order, has_vectors)).collect();
    let mut message = Map::new();
    if let Some(name) = profile {
        let profile = json!({ "name": name, "required_version": ">=3.5" });
        message.insert("session".into(), json!({ "configure": { "profile": profile } }));
    }
    if !arms.is_empty() {
        message.insert("inverse3".into(), arms.into());
    }
    Value::Object(message).to_string()
}

fn arm(order: &Order, has_vectors: bool) -> Value {
    let force = json!({ "x": order.force_n.x, "y": order.force_n.y, "z": order.force_n.z });
    let command = if has_vectors { json!({ "vector": force, "execute": true }) } else { json!({ "values": force }) };
    let mut arm = json!({ "device_id": order.device_id, "commands": { "set_cursor_force": command } });
    if let Some(preset) = order.preset {
        arm["configure"] = json!({ "preset": { "preset": preset } });
    }
    arm
}

/// The version in the answer to `GET /version`, whatever it is wrapped in.
pub(super) fn version(answer: &str) -> Option<(u32, u32)> {
    let (head, body) = answer.split_once("\r\n\r\n")?;
    if head.split_whitespace().nth(1) != Some("200") {
        return None;
    }
    // Lengths of chunks and the like have no dot.
    body.split(|c: char| !c.is_ascii_digit() && c != '.').find_map(|word| {
        let mut parts = word.split('.');
        Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
    })
}
