//! A liver in the abdomen under an endoscope.

use crate::organ::{Hollow, LoadOrgan, OrganSource};
use crate::skin::Skin;
use crate::tools::Intangible;
#[cfg(feature = "render")]
use crate::view::{Endoscope, ScopeLight};
use bevy::prelude::*;

/// The liver that ships with the crate, in the abdomen and, with the feature `render`, under an endoscope.
///
/// Its entity is the [`liver`]; wall ([`abdominal_wall`]) and endoscope ([`liver_endoscope`]) are children, so that all move with it. What is
/// patched is patched on the liver; put the parts together yourself to change the others.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_surgery::prelude::*;
/// # use bevy_surgery::testing::TestApp;
///
/// fn setup(mut commands: Commands) {
///     commands.spawn_scene(bsn! {
///         liver_scene()
///         // A liver of your own, a finer map for blood and burns, and all of it a metre to the right.
///         LoadOrgan { source: OrganSource::File("liver.obj") }
///         Reactions { map_width_px: 2048 }
///         Transform { translation: Vec3 { x: 1.0 } }
///         SurfaceFeel
///     });
/// }
/// # let mut app = TestApp::cpu();
/// # app.add_systems(Startup, setup).finish();
/// # app.update();
/// # let mut livers = app.world_mut().query::<(&LoadOrgan, &Reactions, &Transform, &Skin, &SurfaceFeel)>();
/// # let (organ, reactions, place, ..) = livers.single(app.world())?;
/// # assert_eq!(organ.source, OrganSource::File("liver.obj".into()));
/// # assert_eq!((reactions.map_width_px, reactions.max_sprites, place.translation), (2048, 8192, Vec3::X));
/// # Ok::<(), bevy::ecs::error::BevyError>(())
/// ```
pub fn liver_scene() -> impl Scene {
    bsn! {
        liver()
        Children [
            abdominal_wall(),
            {view()},
        ]
    }
}

#[cfg(feature = "render")]
fn view() -> impl SceneList {
    bsn_list![liver_endoscope()]
}

#[cfg(not(feature = "render"))]
fn view() -> impl SceneList {
    bsn_list![]
}

/// A liver that bleeds, burns and shines: 22 cm wide, its middle at its origin.
pub fn liver() -> impl Scene {
    let (organ, skin, reactions, highlights) = crate::ready::liver();
    bsn! {
        #Liver
        template_value(organ)
        template_value(skin)
        template_value(reactions)
        template_value(highlights)
    }
}

/// The wall of the abdomen, seen from inside; instruments go through it.
pub fn abdominal_wall() -> impl Scene {
    let source = OrganSource::Ellipsoid { semi_axes_m: Vec3::new(0.26, 0.24, 0.26), subdivisions: 6 };
    bsn! {
        #AbdominalWall
        template_value(LoadOrgan { source, ..default() })
        Hollow
        Intangible
        template_value(Skin::mucosa())
    }
}

/// An endoscope that looks at a liver from 20 cm in front and above, with a wide ring of light.
#[cfg(feature = "render")]
pub fn liver_endoscope() -> impl Scene {
    bsn! {
        #Endoscope
        Endoscope
        // As lamps round the trocar have: its reflection is seen as a ring.
        ScopeLight { ring_radius_m: 0.015 }
        template_value(crate::ready::before_liver())
    }
}
