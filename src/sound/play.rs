//! Voices as Bevy's sound plays them, and those of tools.

use super::dials::{DialledVoice, VoiceDials};
use super::tool::{ToolDials, ToolSound, ToolVoice};
use super::voice::Voice;
use crate::tools::ToolWork;
use bevy::audio::{
    AddAudioSource, AudioPlayer, AudioPlugin, ChannelCount, Decodable, PlaybackSettings, SampleRate, Source,
    SpatialListener, SpatialScale,
};
use bevy::prelude::*;
use bevy::time::Real;
use std::time::Duration;

/// What voices of tools are worked out at; Bevy converts it to what the device wants.
const RATE_HZ: u32 = 48_000;

/// So long a voice waits for its tool's next work before it is given up. By then it has long died away.
const KEPT_S: f32 = 2.0;

/// Half of what lies between the ears of [`ears_at_field`].
const EAR_ASIDE_M: f32 = 0.08;

/// A voice as an asset, for `AudioPlayer`; [`VoiceSource::dials`] are turned while it plays. Tools get theirs from [`ToolSound`].
///
/// ```
/// use bevy::prelude::*;
/// use bevy_surgery::sound::{CauteryDials, CauteryVoice, VoiceSource};
///
/// fn sizzle(mut commands: Commands, mut sources: ResMut<Assets<VoiceSource<CauteryVoice>>>) {
///     let source = VoiceSource::new(CauteryVoice::new(48_000, 1));
///     source.dials.turn(CauteryDials { heat: 1.0, water: 0.8 });
///     commands.spawn(AudioPlayer(sources.add(source)));
/// }
/// ```
#[derive(Asset, TypePath, Clone)]
pub struct VoiceSource<V: Voice + TypePath> {
    /// The voice at rest; each player begins with a copy.
    pub voice: V,
    /// What all that play it hear.
    pub dials: VoiceDials<V::Dials>,
}

impl<V: Voice + TypePath> VoiceSource<V> {
    /// A voice with dials of its own.
    pub fn new(voice: V) -> Self {
        Self { voice, dials: VoiceDials::default() }
    }
}

impl<V: Voice + TypePath> Decodable for VoiceSource<V> {
    type Decoder = DialledVoice<V>;

    fn decoder(&self) -> DialledVoice<V> {
        DialledVoice::new(self.voice.clone(), &self.dials)
    }
}

impl<V: Voice> Source for DialledVoice<V> {
    fn current_span_len(&self) -> Option<usize> {
        None
    }

    fn channels(&self) -> ChannelCount {
        ChannelCount::MIN
    }

    fn sample_rate(&self) -> SampleRate {
        SampleRate::new(self.rate_hz()).unwrap_or(SampleRate::MIN)
    }

    fn total_duration(&self) -> Option<Duration> {
        None
    }
}

/// Ears for a camera that looks at its field from a distance: beside the field, as far apart as those of a head.
///
/// At the camera itself a move of some centimetres could not be told from the difference between two ears, as in nature; here it can.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_surgery::sound::ears_at_field;
/// # fn setup(mut commands: Commands) {
/// commands.spawn((Camera3d::default(), ears_at_field(0.25)));
/// # }
/// ```
pub fn ears_at_field(distance_m: f32) -> SpatialListener {
    let ear = |side: f32| Vec3::new(side * EAR_ASIDE_M, 0.0, -distance_m);
    SpatialListener { left_ear_offset: ear(-1.0), right_ear_offset: ear(1.0) }
}

/// Where the app plays sound; elsewhere there is nothing to do.
pub(super) fn add_to(app: &mut App) {
    if !app.is_plugin_added::<AudioPlugin>() {
        return;
    }
    app.add_audio_source::<VoiceSource<super::DrillVoice>>()
        .add_audio_source::<VoiceSource<super::SuctionVoice>>()
        .add_audio_source::<VoiceSource<super::CauteryVoice>>()
        .add_audio_source::<VoiceSource<ToolVoice>>()
        .add_systems(Update, speak);
}

/// The voice of a tool: an entity of its own, so that it can die away where the tool is gone at once.
#[derive(Component)]
struct Speaks {
    tool: Entity,
    dials: VoiceDials<ToolDials>,
    idle_s: f32,
}

/// Gives voices to tools that begin to work, turns their dials, moves them along, and takes those away that were silent for a while.
fn speak(
    mut commands: Commands,
    mut sources: ResMut<Assets<VoiceSource<ToolVoice>>>,
    tools: Query<(Entity, &ToolSound, &ToolWork, Option<&GlobalTransform>)>,
    mut voices: Query<(Entity, &mut Speaks, &mut Transform)>,
    listeners: Query<(), With<SpatialListener>>,
    time: Res<Time<Real>>,
) {
    let mut speaking = Vec::new();
    for (entity, mut speaks, mut transform) in &mut voices {
        let before = speaks.dials.read();
        let now = match tools.get(speaks.tool) {
            Ok((_, sound, work, at)) => {
                // The tool's place of the frame before: nobody hears that.
                let at = at.map_or(transform.translation, GlobalTransform::translation);
                if at.is_finite() && transform.translation != at {
                    transform.translation = at;
                }
                ToolDials { work: *work, drill: sound.drill, gain: sound.gain }
            }
            Err(_) => ToolDials { work: ToolWork::Idle, ..before },
        };
        if now != before {
            speaks.dials.turn(now);
        }
        speaks.idle_s = if now.work == ToolWork::Idle { speaks.idle_s + time.delta_secs() } else { 0.0 };
        if speaks.idle_s > KEPT_S {
            commands.entity(entity).despawn();
        } else {
            speaking.push(speaks.tool);
        }
    }
    for (tool, sound, work, at) in &tools {
        if *work == ToolWork::Idle || speaking.contains(&tool) {
            continue;
        }
        let source = VoiceSource::new(ToolVoice::new(RATE_HZ, sound.seed));
        source.dials.turn(ToolDials { work: *work, drill: sound.drill, gain: sound.gain });
        let speaks = Speaks { tool, dials: source.dials.clone(), idle_s: 0.0 };
        // Without ears Bevy would put its own, four units apart, into the origin: there a tool is next to silent.
        let settings = PlaybackSettings::ONCE
            .with_spatial(!listeners.is_empty())
            .with_spatial_scale(SpatialScale::new(1.0 / sound.full_within_m.max(1e-3)));
        let at = at.map_or(Vec3::ZERO, GlobalTransform::translation);
        let at = if at.is_finite() { at } else { Vec3::ZERO };
        commands.spawn((
            Name::new("voice of a tool"),
            speaks,
            AudioPlayer(sources.add(source)),
            settings,
            Transform::from_translation(at),
        ));
    }
}
