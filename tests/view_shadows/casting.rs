//! What casts, for whom, and when the map is drawn anew.

use super::*;
use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::RenderLayers;
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};

/// A triangle's mesh in each form that Bevy has, kept only in the render world where asked.
fn triangle(topology: PrimitiveTopology, indices: Option<Indices>, usage: RenderAssetUsages) -> Mesh {
    let mut mesh = Mesh::new(topology, usage);
    let corners = vec![[-0.02, -0.02, 0.0], [0.02, -0.02, 0.0], [0.0, 0.02, 0.0]];
    // Attributes before and after the position must not disturb.
    mesh.insert_attribute(Mesh::ATTRIBUTE_UV_0, vec![[0.0, 0.0]; 3]);
    mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, corners);
    mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, vec![[0.0, 0.0, 1.0]; 3]);
    if let Some(indices) = indices {
        mesh.insert_indices(indices);
    }
    mesh
}

#[test]
fn every_kind_of_mesh_casts_the_same() {
    use PrimitiveTopology::{TriangleList, TriangleStrip};
    let both = RenderAssetUsages::default();
    let kinds = [
        (TriangleList, None, both),
        (TriangleList, Some(Indices::U16(vec![0, 1, 2])), both),
        (TriangleList, Some(Indices::U32(vec![2, 0, 1])), RenderAssetUsages::RENDER_WORLD),
        (TriangleStrip, None, both),
        (TriangleStrip, Some(Indices::U16(vec![0, 1, 2])), both),
        (TriangleStrip, Some(Indices::U32(vec![0, 1, 2])), RenderAssetUsages::RENDER_WORLD),
    ];
    let pictures = kinds.map(|(topology, indices, usage)| {
        let mut scene = scene();
        // Another mesh first, so that the triangle does not lie at the beginning of its buffers.
        let other = scene.add_tool(Cuboid::new(0.01, 0.01, 0.01), Transform::from_xyz(0.05, 0.0, 0.03));
        let tilted = Transform::from_xyz(0.0, 0.0, 0.05).with_scale(Vec3::new(1.0, -1.0, 1.0));
        scene.add_tool(triangle(topology, indices, usage), tilted);
        let pictures = scene.pictures();
        assert!(darker(&pictures) > 300, "{topology:?} casts a shadow");
        let everything = darker(&pictures);
        scene.app.world_mut().entity_mut(other).remove::<ToolShadow>();
        let pictures = scene.pictures();
        assert!(darker(&pictures) < everything, "one tool less casts less");
        pictures
    });
    for (kind, [shaded, plain]) in pictures.iter().enumerate().skip(1) {
        // Bevy itself does not draw every kind of strip; what is no tool must be shaded alike.
        let both = shaded.pixels().zip(plain.pixels()).zip(pictures[0][0].pixels().zip(pictures[0][1].pixels()));
        let count = both.filter(|((a, a_plain), (b, b_plain))| a_plain == b_plain && a != b).count();
        assert!(count < 10, "shadows of kind {kind} differ from those of the first in {count} pixels");
    }
}

#[test]
fn the_map_is_drawn_when_something_moved() {
    let mut scene = scene();
    let tool = scene.add_tool(Cuboid::new(0.01, 0.01, 0.02), Transform::from_xyz(0.0, 0.0, 0.04));
    scene.app.capture();
    assert_eq!(scene.redraws(), 1);
    for _ in 0..5 {
        scene.app.idle();
    }
    // Camera, softness and strength are nothing to the map; two cameras share it.
    let target = RenderTarget::Image(scene.app.target().image.into());
    let second =
        (Camera3d::default(), Camera { order: 1, ..default() }, target, Msaa::Off, Transform::from_xyz(0.0, 0.0, 0.3));
    scene.app.world_mut().spawn(second);
    scene.app.world_mut().get_mut::<Transform>(scene.camera).expect("placed").translation.x += 0.02;
    scene.app.world_mut().entity_mut(scene.lamp).insert(ToolShadows { strength: 0.3, softness_m: 0.001, ..shadows() });
    scene.app.capture();
    assert_eq!(scene.redraws(), 1, "nothing that the map shows has changed");
    let mut expect = |what: &str, change: &mut dyn FnMut(&mut Scene)| {
        let before = scene.redraws();
        change(&mut scene);
        scene.app.idle();
        scene.app.idle();
        assert_eq!(scene.redraws() - before, 1, "{what}");
    };
    expect("the tool moved", &mut |scene| {
        scene.app.world_mut().get_mut::<Transform>(tool).expect("placed").translation.x += 0.01;
    });
    expect("the lamp moved", &mut |scene| {
        scene.app.world_mut().get_mut::<Transform>(scene.lamp).expect("placed").translation.x += 0.01;
    });
    expect("the lens changed", &mut |scene| {
        scene.app.world_mut().get_mut::<ToolShadows>(scene.lamp).expect("a lamp").half_angle_rad = 0.3;
    });
    expect("the mesh changed", &mut |scene| {
        let mesh = scene.app.world().get::<Mesh3d>(tool).expect("a mesh").0.clone();
        let mut meshes = scene.app.world_mut().resource_mut::<Assets<Mesh>>();
        let mut mesh = meshes.get_mut(&mesh).expect("in the main world");
        let Some(VertexAttributeValues::Float32x3(positions)) = mesh.attribute_mut(Mesh::ATTRIBUTE_POSITION) else {
            panic!("no positions");
        };
        positions.iter_mut().for_each(|position| position[0] *= 2.0);
    });
    expect("the resolution changed", &mut |scene| {
        scene.app.world_mut().get_mut::<ToolShadows>(scene.lamp).expect("a lamp").resolution_px = 128;
    });
}

#[test]
fn layers_and_limits_are_kept() {
    let mut scene = scene();
    let tool = scene.add_tool(Cuboid::new(0.01, 0.01, 0.02), Transform::from_xyz(0.0, 0.0, 0.04));
    let one = darker(&scene.pictures());
    assert!(one > 200);
    scene.app.world_mut().entity_mut(scene.lamp).insert(RenderLayers::layer(3));
    assert_eq!(darker(&scene.pictures()), 0, "the tool is not on the lamp's layer");
    scene.app.world_mut().entity_mut(tool).insert(RenderLayers::from_layers(&[0, 3]));
    assert_eq!(darker(&scene.pictures()), 0, "the camera is not on the lamp's layer");
    scene.app.world_mut().entity_mut(scene.camera).insert(RenderLayers::from_layers(&[0, 3]));
    assert_eq!(darker(&scene.pictures()), one);
    scene.app.world_mut().entity_mut(scene.lamp).insert(Visibility::Hidden);
    assert_eq!(darker(&scene.pictures()), 0, "a lamp that is off");
    scene.app.world_mut().entity_mut(scene.lamp).insert((Visibility::Visible, RenderLayers::default()));
    // A second lamp beside the first adds its shadow, a third one does not count.
    let lamp = |x: f32| (shadows(), Transform::from_xyz(x, 0.03, 0.25).looking_at(Vec3::ZERO, Vec3::Y));
    let with_one = scene.app.capture();
    let mut lamps = vec![scene.lamp, scene.app.world_mut().spawn(lamp(-0.06)).id()];
    let with_two = scene.app.capture();
    assert!(darker(&[with_two, with_one]) > 50, "the second lamp's shadow lies beside the first one's");
    lamps.push(scene.app.world_mut().spawn(lamp(0.0)).id());
    scene.app.capture();
    let maps = scene.app.sub_app(RenderApp).world().resource::<ToolShadowMaps>();
    lamps.sort();
    let used: Vec<bool> = lamps.iter().map(|lamp| maps.texture(*lamp).is_some()).collect();
    assert_eq!(used, [true, true, false], "the lowest entities count");
}
