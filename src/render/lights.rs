//! The lights that organs are lit by: Bevy's own and the endoscope's, collected once per frame.

use bevy::camera::visibility::RenderLayers;
use bevy::light::{DirectionalLight, GlobalAmbientLight, PointLight, SpotLight};
use bevy::prelude::*;
use bevy::render::render_resource::ShaderType;
use bevy::render::{Extract, ExtractSchedule, RenderApp};
use std::f32::consts::PI;

/// How many of Bevy's lights reach one organ: the strongest at its centre.
pub const MAX_SCENE_LIGHTS: usize = 8;
/// How many endoscope lights reach one organ, besides [`MAX_SCENE_LIGHTS`].
pub const MAX_SCOPE_LIGHTS: usize = 2;

/// One light in world space, as the shaders read it (`shaders/lights.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct LightUniform {
    /// Linear colour times illuminance in lux (directional) or luminous intensity in candela (the others).
    pub colour: Vec3,
    /// 0 directional, 1 point, 2 spot, 3 ring on an endoscope.
    pub kind: u32,
    /// Position in the world, metres; unused by directional lights.
    pub position_world_m: Vec3,
    /// One over the square of the distance at which the light ends, per square metre; 0 for no end.
    pub inverse_range_squared: f32,
    /// Unit direction that the light travels along its axis, in the world.
    pub direction_world: Vec3,
    /// Radius of the ring of an endoscope, metres.
    pub ring_radius_m: f32,
    /// Spot cone: `saturate(cos * scale + offset)` squared is the attenuation.
    pub cone_scale: f32,
    /// See [`LightUniform::cone_scale`].
    pub cone_offset: f32,
    /// Share of the light that comes back from the cavity's walls from all sides (ring lights only).
    pub ambient_fraction: f32,
}

impl LightUniform {
    /// Directional light.
    pub const DIRECTIONAL: u32 = 0;
    /// Point light.
    pub const POINT: u32 = 1;
    /// Spot light.
    pub const SPOT: u32 = 2;
    /// Ring light of an endoscope.
    pub const RING: u32 = 3;

    /// Scale and offset of a cone that is full inside `inner_rad` and dark outside `outer_rad` (half angles).
    pub fn cone(inner_rad: f32, outer_rad: f32) -> (f32, f32) {
        let cos_outer = outer_rad.cos();
        let scale = 1.0 / (inner_rad.cos() - cos_outer).max(1e-4);
        (scale, -cos_outer * scale)
    }

    /// Illuminance in lux that a surface facing the light receives at a point (the CPU twin of the shader's formula).
    pub fn illuminance_lux(&self, point_world_m: Vec3) -> Vec3 {
        if self.kind == Self::DIRECTIONAL {
            return self.colour;
        }
        let to_light = self.position_world_m - point_world_m;
        let distance_squared = to_light.length_squared() + self.ring_radius_m * self.ring_radius_m;
        let range = distance_squared * self.inverse_range_squared;
        let window = (1.0 - range * range).clamp(0.0, 1.0);
        let mut attenuation = window * window / distance_squared.max(1e-4 * 1e-4);
        if self.kind != Self::POINT {
            let cosine = -self.direction_world.dot(to_light.normalize_or_zero());
            let cone = (cosine * self.cone_scale + self.cone_offset).clamp(0.0, 1.0);
            attenuation *= cone * cone;
        }
        self.colour * attenuation
    }
}

/// The lights of one organ.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct OrganLights {
    /// The lights in use come first.
    pub lights: [LightUniform; MAX_SCENE_LIGHTS + MAX_SCOPE_LIGHTS],
    /// Bevy's global ambient light: linear colour times brightness, candela per square metre.
    pub ambient: Vec3,
    /// How many of `lights` are in use.
    pub count: u32,
}

/// A light of the scene with the layers that it shines on.
#[derive(Clone, Debug)]
pub struct SceneLight {
    /// The light itself.
    pub light: LightUniform,
    /// Layers that it reaches.
    pub layers: RenderLayers,
    /// Its entity in the main world, which settles ties.
    pub entity: Entity,
}

/// Every visible light of the frame (render world).
#[derive(Resource, Default)]
pub struct SceneLights {
    /// In order of their entities.
    pub lights: Vec<SceneLight>,
    /// Bevy's global ambient light: linear colour times brightness, candela per square metre.
    pub ambient: Vec3,
}

/// Chooses the lights of an organ: up to [`MAX_SCOPE_LIGHTS`] endoscopes and the [`MAX_SCENE_LIGHTS`] others that are
/// strongest at its centre. Ties go to the older entity, so that the choice does not flicker.
pub fn strongest_lights(scene: &SceneLights, centre_world_m: Vec3, layers: &RenderLayers) -> OrganLights {
    let mut ranked: Vec<(f32, &SceneLight)> = scene
        .lights
        .iter()
        .filter(|light| light.layers.intersects(layers))
        .map(|light| (light.light.illuminance_lux(centre_world_m).dot(Vec3::new(0.2126, 0.7152, 0.0722)), light))
        .collect();
    ranked.sort_by(|(a, light_a), (b, light_b)| b.total_cmp(a).then(light_a.entity.cmp(&light_b.entity)));
    let mut chosen = OrganLights { ambient: scene.ambient, ..default() };
    for (is_ring, limit) in [(true, MAX_SCOPE_LIGHTS), (false, MAX_SCENE_LIGHTS)] {
        let kind = ranked.iter().filter(|(_, light)| (light.light.kind == LightUniform::RING) == is_ring);
        for (_, light) in kind.take(limit) {
            chosen.lights[chosen.count as usize] = light.light;
            chosen.count += 1;
        }
    }
    chosen
}

/// Starts the frame's list; plugins with lights of their own add to it `.after` this.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct ExtractSceneLights;

pub(super) fn build(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .init_resource::<SceneLights>()
        .add_systems(ExtractSchedule, extract_scene_lights.in_set(ExtractSceneLights));
}

type LightQuery<'w, 's, L> = Extract<
    'w,
    's,
    Query<
        'static,
        'static,
        (Entity, &'static L, &'static GlobalTransform, &'static InheritedVisibility, Option<&'static RenderLayers>),
    >,
>;

fn extract_scene_lights(
    mut scene: ResMut<SceneLights>,
    ambient: Extract<Option<Res<GlobalAmbientLight>>>,
    directional: LightQuery<DirectionalLight>,
    points: LightQuery<PointLight>,
    spots: LightQuery<SpotLight>,
) {
    let linear = |colour: Color| colour.to_linear().to_vec3();
    scene.ambient = ambient.as_ref().map_or(Vec3::ZERO, |ambient| linear(ambient.color) * ambient.brightness);
    scene.lights.clear();
    let mut add = |entity, layers: Option<&RenderLayers>, light| {
        scene.lights.push(SceneLight { light, layers: layers.cloned().unwrap_or_default(), entity });
    };
    for (entity, light, transform, visible, layers) in directional.iter() {
        if visible.get() {
            add(
                entity,
                layers,
                LightUniform {
                    colour: linear(light.color) * light.illuminance,
                    kind: LightUniform::DIRECTIONAL,
                    direction_world: transform.forward().into(),
                    ..default()
                },
            );
        }
    }
    for (entity, light, transform, visible, layers) in points.iter() {
        if visible.get() {
            add(
                entity,
                layers,
                LightUniform {
                    colour: linear(light.color) * light.intensity / (4.0 * PI),
                    kind: LightUniform::POINT,
                    position_world_m: transform.translation(),
                    inverse_range_squared: 1.0 / (light.range * light.range),
                    ..default()
                },
            );
        }
    }
    for (entity, light, transform, visible, layers) in spots.iter() {
        if visible.get() {
            let (cone_scale, cone_offset) = LightUniform::cone(light.inner_angle, light.outer_angle);
            add(
                entity,
                layers,
                LightUniform {
                    // Bevy divides a spot's lumens by the full sphere too, so that narrowing the cone keeps its brightness.
                    colour: linear(light.color) * light.intensity / (4.0 * PI),
                    kind: LightUniform::SPOT,
                    position_world_m: transform.translation(),
                    inverse_range_squared: 1.0 / (light.range * light.range),
                    direction_world: transform.forward().into(),
                    cone_scale,
                    cone_offset,
                    ..default()
                },
            );
        }
    }
    scene.lights.sort_by_key(|light| light.entity);
}
