//! What all voices have in common.

/// Something that is heard: an endless row of samples from -1 to 1, and dials that change what they sound like.
///
/// No dial makes a click, however it jumps, and what is no number changes nothing.
pub trait Voice: Iterator<Item = f32> + Clone + Send + Sync + 'static {
    /// What one can turn.
    type Dials: Copy + Default + Send + Sync + 'static;

    /// Turns the dials.
    fn turn(&mut self, dials: Self::Dials);

    /// Samples a second.
    fn rate_hz(&self) -> u32;

    /// Whether nothing will be heard until a dial is turned.
    fn is_silent(&self) -> bool;
}
