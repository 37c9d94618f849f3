//! Tools that are heard: the ECS side. Machines without a device that plays run these too, and hear as little.

use bevy::audio::{AudioPlayer, AudioPlugin, Decodable, GlobalVolume, PlaybackSettings, SpatialListener, Volume};
use bevy::prelude::*;
use bevy_surgery::sound::{ToolSound, ToolVoice, VoiceSource, ears_at_field};
use bevy_surgery::testing::TestApp;
use bevy_surgery::tools::ToolWork;

const DRILLING: ToolWork = ToolWork::Drilling { speed_rpm: 40_000.0, force_n: 1.0, contact: 0.5, hardness: 1.0 };

fn app() -> TestApp {
    let mut app = TestApp::cpu();
    // Nobody who runs the tests needs to hear them.
    app.add_plugins(AudioPlugin { global_volume: GlobalVolume::new(Volume::Linear(0.0)), ..default() });
    app
}

type Player = AudioPlayer<VoiceSource<ToolVoice>>;

/// The voices that there are: settings, place, source.
fn voices(app: &mut TestApp) -> Vec<(PlaybackSettings, Vec3, VoiceSource<ToolVoice>)> {
    let world = app.world_mut();
    let mut players = world.query::<(&Player, &PlaybackSettings, &GlobalTransform)>();
    let sources = world.resource::<Assets<VoiceSource<ToolVoice>>>();
    let source = |player: &Player| sources.get(&player.0).expect("its source").clone();
    players.iter(world).map(|(player, settings, at)| (*settings, at.translation(), source(player))).collect()
}

fn rms(samples: impl Iterator<Item = f32>) -> f32 {
    let (sum, count) = samples.fold((0.0, 0), |(sum, count), sample| (sum + sample * sample, count + 1));
    (sum / count as f32).sqrt()
}

#[test]
fn a_tool_that_works_is_heard_where_it_is() {
    let mut app = app();
    app.world_mut().spawn((Transform::default(), ears_at_field(0.25)));
    let at = Transform::from_xyz(0.01, 0.02, -0.25);
    let tool = app.world_mut().spawn((at, ToolWork::Idle, ToolSound::default())).id();
    app.step(3);
    assert!(voices(&mut app).is_empty(), "a tool that does nothing needs no voice");
    *app.world_mut().get_mut::<ToolWork>(tool).expect("its work") = DRILLING;
    app.step(2);
    let [(settings, place, source)] = &voices(&mut app)[..] else { panic!("one voice") };
    assert!(settings.spatial && (settings.spatial_scale.expect("a scale").0.x - 20.0).abs() < 1e-4);
    assert_eq!((*place, source.dials.read().work), (at.translation, DRILLING));
    let mut heard = source.decoder();
    assert!(rms(heard.by_ref().take(24_000)) > 0.05);

    app.world_mut().get_mut::<Transform>(tool).expect("its place").translation.x = 0.03;
    let sucking = ToolWork::Sucking { strength: 1.0, liquid: 0.3 };
    *app.world_mut().get_mut::<ToolWork>(tool).expect("its work") = sucking;
    app.world_mut().get_mut::<ToolSound>(tool).expect("its sound").gain = 0.5;
    app.step(2);
    let [(_, place, source)] = &voices(&mut app)[..] else { panic!("the same voice") };
    assert_eq!(place.x, 0.03);
    assert_eq!((source.dials.read().work, source.dials.read().gain), (sucking, 0.5));
    assert!(rms(heard.by_ref().skip(24_000).take(24_000)) > 0.02, "who plays hears the turned dials");
}

#[test]
fn a_voice_dies_away_before_it_goes() {
    for gone in [false, true] {
        let mut app = app();
        let tool = app.world_mut().spawn((Transform::default(), DRILLING, ToolSound::default())).id();
        app.step(2);
        let mut heard = voices(&mut app)[0].2.decoder();
        assert!(rms(heard.by_ref().take(24_000)) > 0.05);
        if gone {
            app.world_mut().despawn(tool);
        } else {
            *app.world_mut().get_mut::<ToolWork>(tool).expect("its work") = ToolWork::Idle;
        }
        app.step(60);
        assert_eq!(voices(&mut app).len(), 1, "a second later it is still there, silent");
        heard.by_ref().take(48_000).for_each(drop);
        assert_eq!(rms(heard.by_ref().take(4800)), 0.0);
        app.step(90);
        assert!(voices(&mut app).is_empty());
        assert!(app.world().resource::<Assets<VoiceSource<ToolVoice>>>().is_empty(), "its asset went with it");
        if !gone {
            *app.world_mut().get_mut::<ToolWork>(tool).expect("its work") = DRILLING;
            app.step(2);
            assert_eq!(voices(&mut app).len(), 1, "and begins anew");
        }
    }
}

#[test]
fn without_ears_a_tool_is_heard_in_the_middle_and_without_audio_not_at_all() {
    let mut app = app();
    let scene = (Transform::from_xyz(f32::NAN, 0.0, 0.0), DRILLING, ToolSound { full_within_m: 0.0, ..default() });
    app.world_mut().spawn(scene);
    app.step(2);
    let [(settings, place, _)] = &voices(&mut app)[..] else { panic!("one voice") };
    assert!(!settings.spatial && place.is_finite());

    let mut silent = TestApp::cpu();
    silent.world_mut().spawn(scene);
    silent.step(2);
    assert!(silent.world().get_resource::<Assets<VoiceSource<ToolVoice>>>().is_none());
}

#[test]
fn ears_hang_beside_the_field() {
    let SpatialListener { left_ear_offset, right_ear_offset } = ears_at_field(0.2);
    // A camera looks along its -Z, with +X to the right.
    assert_eq!(left_ear_offset + right_ear_offset, Vec3::new(0.0, 0.0, -0.4));
    assert!(right_ear_offset.x > 0.05, "tools in the field stay further away than where Bevy pans to the wrong side");
    assert!(right_ear_offset.x - 0.029 > ToolSound::default().full_within_m);
}
