//! Messages about contacts, not more of them than anyone can use.
//!
//! The paper of 2002 (section 5.4) discards a share of its interface's events, so that they do not saturate what has to answer
//! them. Contacts themselves are found in every step ([`ToolContacts`]); messages about them come when they begin and end, and in
//! between at a bounded rate.

use super::{Contact, ToolContacts, ToolPart};
use crate::checkpoint::KeepState;
use crate::tools::{Tool, ToolOrder, TouchTools};
use bevy::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A tool touches something. Written in [`SurgerySystems::Touch`](crate::schedule::SurgerySystems::Touch).
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
pub struct ToolTouched {
    /// The tool.
    pub tool: Entity,
    /// The contact; when it ends, as it was last.
    pub contact: Contact,
    /// Whether it begins, lasts or ends.
    pub phase: ContactPhase,
}

/// Where a contact is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
pub enum ContactPhase {
    /// There was none with this body and part in the step before.
    Began,
    /// It goes on.
    Lasts,
    /// There is none any more.
    Ended,
}

/// How often contacts that last are told of.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Resource, Default, Clone)]
pub struct ContactEvents {
    /// Times per second, for each tool, part and body.
    pub per_second: f32,
}

impl Default for ContactEvents {
    /// As often as the paper's frames.
    fn default() -> Self {
        Self { per_second: 25.0 }
    }
}

/// What was told of contacts that last.
#[derive(Resource, Clone, Default)]
struct ToldContacts(BTreeMap<(Entity, Entity, ToolPart), Told>);

/// What was told of a contact.
#[derive(Clone)]
struct Told {
    contact: Contact,
    since_s: f32,
}

pub(super) fn build(app: &mut App) {
    app.init_resource::<ContactEvents>()
        .register_type::<ContactEvents>()
        .register_type::<ContactPhase>()
        .register_type::<ToolTouched>()
        .add_message::<ToolTouched>()
        .init_resource::<ToldContacts>()
        .keep_resource::<ToldContacts>()
        .add_systems(FixedUpdate, tell.in_set(TouchTools::Tell));
}

fn tell(
    order: Res<ToolOrder>,
    tools: Query<(Entity, &ToolContacts), With<Tool>>,
    settings: Res<ContactEvents>,
    time: Res<Time>,
    mut touched: MessageWriter<ToolTouched>,
    mut told: ResMut<ToldContacts>,
) {
    let told = &mut told.0;
    for told in told.values_mut() {
        told.since_s += time.delta_secs();
    }
    for (tool, contacts) in tools.iter_many(&order.0) {
        for &contact in &contacts.list {
            let phase = match told.get_mut(&(tool, contact.body, contact.part)) {
                None => {
                    told.insert((tool, contact.body, contact.part), Told { contact, since_s: 0.0 });
                    ContactPhase::Began
                }
                Some(told) => {
                    told.contact = contact;
                    // Rounding must not make one step in so many come too late.
                    if told.since_s * settings.per_second < 0.999 {
                        continue;
                    }
                    told.since_s = 0.0;
                    ContactPhase::Lasts
                }
            };
            touched.write(ToolTouched { tool, contact, phase });
        }
    }
    told.retain(|&(tool, body, part), told| {
        let lasts = tools.get(tool).is_ok_and(|(_, contacts)| contacts.of(body, part).is_some());
        if !lasts {
            touched.write(ToolTouched { tool, contact: told.contact, phase: ContactPhase::Ended });
        }
        lasts
    });
}
