//! How much of the volumes was drawn anew.

use bevy::math::URect;
use bevy::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Pixels of volumes that were drawn anew in this frame, in all views together (render world). The others were put into the
/// picture from what earlier frames left.
#[derive(Resource, Debug, Default)]
pub struct VolumeRedraws {
    walked_px: AtomicU64,
    shaded_px: AtomicU64,
}

impl VolumeRedraws {
    pub(super) fn add_walked(&self, pixels: URect) {
        self.walked_px.fetch_add(area(pixels), Ordering::Relaxed);
    }

    pub(super) fn add_shaded(&self, pixels: URect) {
        self.shaded_px.fetch_add(area(pixels), Ordering::Relaxed);
    }

    /// Pixels through which rays were walked or slices drawn.
    pub fn walked_px(&self) -> u64 {
        self.walked_px.load(Ordering::Relaxed)
    }

    /// Pixels whose light was worked out.
    pub fn shaded_px(&self) -> u64 {
        self.shaded_px.load(Ordering::Relaxed)
    }
}

fn area(pixels: URect) -> u64 {
    u64::from(pixels.width()) * u64::from(pixels.height())
}

pub(super) fn start_frame(mut redraws: ResMut<VolumeRedraws>) {
    *redraws = default();
}
