//! Turning the dials of a voice while another thread plays it.

use super::voice::Voice;
use crate::haptics::exchange::{Publisher, Subscriber, exchange};
use std::sync::{Arc, Mutex, MutexGuard, Weak};

/// Dials that a simulation turns while voices play elsewhere; clones turn the same ones.
///
/// Voices take what was turned without ever waiting: only those who turn share a lock.
///
/// ```
/// use bevy_surgery::sound::{DialledVoice, SuctionDials, SuctionVoice, VoiceDials};
///
/// let dials = VoiceDials::default();
/// let mut voice = DialledVoice::new(SuctionVoice::new(48_000, 1), &dials);
/// dials.turn(SuctionDials { strength: 1.0, liquid: 0.5 });
/// assert!(voice.by_ref().take(4800).any(|sample| sample.abs() > 0.01));
/// ```
pub struct VoiceDials<T> {
    turned: Arc<Mutex<Turned<T>>>,
}

struct Turned<T> {
    now: T,
    /// A way to each voice that plays, and whether it still does.
    ways: Vec<(Publisher<T>, Weak<()>)>,
}

impl<T> Clone for VoiceDials<T> {
    fn clone(&self) -> Self {
        Self { turned: self.turned.clone() }
    }
}

impl<T: Default> Default for VoiceDials<T> {
    fn default() -> Self {
        Self { turned: Arc::new(Mutex::new(Turned { now: T::default(), ways: Vec::new() })) }
    }
}

impl<T: Copy + Default> VoiceDials<T> {
    /// Turns them.
    pub fn turn(&self, to: T) {
        let mut turned = self.lock();
        turned.now = to;
        turned.ways.retain_mut(|(way, voice)| {
            way.publish(to);
            voice.strong_count() > 0
        });
    }

    /// As they are turned.
    pub fn read(&self) -> T {
        self.lock().now
    }

    /// How many voices hear them.
    pub fn voices(&self) -> usize {
        self.lock().ways.iter().filter(|(_, voice)| voice.strong_count() > 0).count()
    }

    fn lock(&self) -> MutexGuard<'_, Turned<T>> {
        // A panic of another turner leaves whole values behind.
        self.turned.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

/// A voice that follows dials.
pub struct DialledVoice<V: Voice> {
    voice: V,
    heard: Subscriber<V::Dials>,
    _plays: Arc<()>,
}

impl<V: Voice> DialledVoice<V> {
    /// A voice that begins with the dials as they are.
    pub fn new(mut voice: V, dials: &VoiceDials<V::Dials>) -> Self {
        let (way, heard) = exchange();
        let plays = Arc::new(());
        let mut turned = dials.lock();
        voice.turn(turned.now);
        turned.ways.push((way, Arc::downgrade(&plays)));
        Self { voice, heard, _plays: plays }
    }

    /// Samples a second.
    pub fn rate_hz(&self) -> u32 {
        self.voice.rate_hz()
    }
}

impl<V: Voice> Iterator for DialledVoice<V> {
    type Item = f32;

    fn next(&mut self) -> Option<f32> {
        if self.heard.take_newest()
            && let Some(dials) = self.heard.read(|dials| *dials)
        {
            self.voice.turn(dials);
        }
        self.voice.next()
    }
}
