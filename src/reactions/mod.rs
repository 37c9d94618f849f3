//! Layer 2 of an organ: how it reacts (paper of 2002, sections 3.2, 3.3, 4.2 and 5).
//!
//! An organ with [`Reactions`] bleeds, turns pale and burns where [`OrganTouch`] says. Effects are snakes of sprites that
//! live in a texture over the organ's chart ([`snake`], [`kind`]); drops of blood roll in space ([`drops`]), heat spreads
//! in a map of its own ([`heat`]), and what changed is painted ([`footprint`], [`paint`]) and sent to the GPU
//! ([`regions`]). [`ReactionModel`] is all of that for one organ and runs without a GPU.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_surgery::prelude::*;
//! fn setup(mut commands: Commands, assets: Res<AssetServer>) {
//!     commands.spawn((Organ(assets.load("liver.obj")), Skin::liver(), Reactions::default(), Highlights::default()));
//! }
//!
//! // In `SurgerySystems::Touch`: burn where a ray meets an organ.
//! fn burn(picking: OrganPicking, mut touches: MessageWriter<OrganTouch>) {
//!     let ray = Ray3d::new(Vec3::new(0.0, 0.2, 0.0), Dir3::NEG_Y);
//!     if let Some(hit) = picking.cast_ray(ray, 1.0) {
//!         let action = ReactionAction::Cauterize(Cautery::coagulate(30.0));
//!         touches.write(OrganTouch { organ: hit.organ, point: hit.point, instrument: 0, action });
//!     }
//! }
//! ```

pub mod action;
pub mod burn;
pub mod drops;
pub mod footprint;
pub mod heat;
pub mod kind;
pub mod kinds;
pub mod model;
pub mod paint;
pub mod regions;
#[cfg(feature = "render")]
mod render;
mod settings;
pub mod snake;
mod systems;
pub mod texels;

pub use action::{OrganTouch, ReactionAction, Wound};
pub use model::{ReactionEvent, ReactionModel, ReactionTally};
pub use settings::{ReactionFault, Reactions};
pub use systems::OrganReacted;

use bevy::prelude::*;

/// Lets organs react. See the [module](self).
pub struct ReactionsPlugin;

impl Plugin for ReactionsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<kind::ReactionKinds>();
        systems::build(app);
        app.register_type::<Reactions>()
            .register_type::<ReactionModel>()
            .register_type::<OrganTouch>()
            .register_type::<OrganReacted>()
            .register_type::<ReactionEvent>()
            .register_type::<ReactionFault>()
            .register_type::<ReactionTally>()
            .register_type::<kinds::Blood>()
            .register_type::<kinds::Whitening>()
            .register_type::<kinds::Cauterization>()
            .register_type::<kinds::Nodule>()
            .register_type::<snake::Snake>()
            .register_type::<snake::Sprite>()
            .register_type::<kind::KindId>()
            .register_type::<kind::SpriteLook>()
            .register_type::<kind::SpriteFate>()
            .register_type::<model::Touch>()
            .register_type::<model::OpenWound>()
            .register_type::<model::TexelSize>()
            .register_type::<action::Wound>()
            .register_type::<action::ReactionAction>();
        app.register_type::<burn::BurnLook>()
            .register_type::<burn::BurnStop>()
            .register_type::<burn::BurnRamp>()
            .register_type::<burn::Cautery>()
            .register_type::<heat::HeatMap>()
            .register_type::<heat::HeatSettings>()
            .register_type::<drops::DropSettings>()
            .register_type::<drops::DropHead>()
            .register_type::<drops::DropFate>()
            .register_type::<drops::DropCollisions>()
            .register_type::<drops::Walk>()
            .register_type::<drops::WalkStop>()
            .register_type::<drops::WalkError>()
            .register_type::<regions::Changes>()
            .register_type::<regions::UploadLog>()
            .register_type::<footprint::Footprint>()
            .register_type::<paint::Profile>()
            .register_type::<paint::ReactionMap>()
            .register_type::<paint::PermanentMap>()
            .register_type::<texels::MapSize>()
            .register_type::<texels::TexelRect>()
            .register_type::<texels::TileMask>();
        #[cfg(feature = "render")]
        render::build(app);
    }
}
