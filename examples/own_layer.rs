//! A layer of your own between two of the crate's: fluorescence, as surgeons see it when a dye (indocyanine green) shows
//! which tissue has blood. It is drawn over the skin and under blood, burns and reflections.

mod common;

use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::{Render, RenderApp, RenderStartup, RenderSystems};
use bevy_surgery::organ::render::*;
use bevy_surgery::prelude::*;
use common::{Args, Stage, Viewer};
use std::process::ExitCode;

/// The shader has an organ's vertices and lights (`bevy_surgery::organ`, `bevy_surgery::lights`) and what you bind.
const SHADER: &str = "
#import bevy_surgery::organ::{CornerVertex, secondary_vertex, view}
struct Varying { @invariant @builtin(position) clip: vec4<f32>, @location(0) rest_position_m: vec3<f32> }
@vertex
fn vertex(corner: CornerVertex) -> Varying {
    let place = secondary_vertex(corner).position_world_m;
    return Varying(view.clip_from_world * vec4(place, 1.0), corner.rest_position_m);
}
@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    let perfused = smoothstep(0.01, 0.04, in.rest_position_m.x + 0.01 * sin(90.0 * in.rest_position_m.y));
    return vec4(0.05, 0.9, 0.35, 0.5 * perfused);
}";

/// Names the layer.
struct Fluorescence;

/// What it binds beside the view and the organ: nothing.
#[derive(Resource)]
struct OwnGroup(BindGroup);

fn add_layer(app: &mut App) {
    let Some(mut shaders) = app.world_mut().get_resource_mut::<Assets<Shader>>() else { return };
    let shader = shaders.add(Shader::from_wgsl(SHADER, "fluorescence.wgsl"));
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .insert_resource(LayerShader(shader))
        .add_systems(RenderStartup, init_layer.after(PrepareOrgans))
        .add_systems(Render, prepare_layer_pipelines::<Fluorescence>.in_set(RenderSystems::PrepareResources))
        .add_systems(Render, bind.in_set(RenderSystems::PrepareBindGroups))
        .add_systems(Core3d, draw.after(OrganPasses::Skin).before(OrganPasses::HighlightsUnder));
}

#[derive(Resource)]
struct LayerShader(Handle<Shader>);

fn init_layer(mut commands: Commands, layouts: Res<OrganLayouts>, shader: Res<LayerShader>) {
    let own = vec![BindGroupLayoutDescriptor::new("fluorescence_layout", &[])];
    let blend = Some(BlendState::ALPHA_BLENDING);
    commands.insert_resource(OrganLayer::<Fluorescence>::new("fluorescence", &layouts, own, shader.0.clone(), blend));
}

fn bind(
    mut commands: Commands,
    layer: Res<OrganLayer<Fluorescence>>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    let layout = cache.get_bind_group_layout(&layer.own_groups[0]);
    commands.insert_resource(OwnGroup(device.create_bind_group("fluorescence", &layout, &[])));
}

fn draw(view: ViewQuery<OrganLayerView<Fluorescence>>, organs: OrganDraw, own: Res<OwnGroup>, mut ctx: RenderContext) {
    // The closure says which organs have the layer; here all have.
    organs.draw("fluorescence", view, &mut ctx, |_| Some(&own.0));
}

fn main() -> ExitCode {
    common::main_with(
        "own_layer",
        |app| {
            add_layer(app);
            app.add_systems(Startup, setup).add_systems(FixedUpdate, turn.in_set(SurgerySystems::Sense));
        },
        |_| default(),
    )
}

fn setup(
    mut commands: Commands,
    args: Res<Args>,
    stage: Res<Stage>,
    assets: Res<AssetServer>,
    mut models: ResMut<Assets<OrganModel>>,
) -> Result {
    let options = OrganOptions::default().with_largest_extent_m(0.2).centred();
    let organ = common::organ(&args, None, options, &assets, &mut models)?;
    commands.spawn((Organ(organ), Skin::liver(), Reactions::default(), Highlights::default()));
    let view = Transform::from_xyz(0.0, 0.1, 0.2).looking_at(Vec3::ZERO, Vec3::Y);
    commands.spawn((Endoscope::default(), stage.target.clone(), view));
    Ok(())
}

fn turn(stage: Res<Stage>, mut organs: Query<&mut Transform, With<Organ>>) {
    for mut transform in organs.iter_mut().filter(|_| stage.viewer != Viewer::Recording) {
        transform.rotate_y(0.01);
    }
}
