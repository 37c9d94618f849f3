//! Electrodes burn organs and seal vessels in bone.

use super::tool_number;
use crate::organ::atlas::{Atlas, texel_at};
use crate::organ::{Organ, OrganModel, SurfacePoint};
use crate::pool::{BleedingControl, TreatBleeders};
use crate::reactions::burn::Cautery;
use crate::reactions::{OrganTouch, ReactionAction, ReactionModel};
use crate::tools::state::ToolState;
use crate::tools::{
    ContactMatter, Tool, ToolCommand, ToolContacts, ToolKind, ToolMotion, ToolOrder, ToolPart, ToolWork,
};
use bevy::prelude::*;

/// Power at which it is as loud as it gets, watts.
const LOUDEST_W: f64 = 60.0;
/// Heat per area at which tissue holds no water any more, J/mm2: where the default burns are char.
const DRY_J_PER_MM2: f32 = 0.95;
/// What bleeds within so much of a coagulating tip is sealed, metres.
const SEAL_M: f32 = 2e-3;

/// What an electrode gives now: coagulation under the pedal, cut under the second one.
pub(super) fn power(tool: &Tool, state: &ToolState) -> Option<(Cautery, bool)> {
    let ToolKind::CauteryHook(electrodes) = tool.kind else { return None };
    if state.command.second_pedal >= ToolCommand::DOWN {
        return Some((electrodes.cut, false));
    }
    state.is_pedal_down().then_some((electrodes.coagulation, true))
}

/// Water that is left in the tissue at a place, from 0 to 1.
fn water(reactions: &ReactionModel, atlas: &Atlas, point: SurfacePoint) -> f32 {
    let size = reactions.size();
    let (x, y) = texel_at(atlas.uv(point), size.width_px, size.height_px);
    let dose = reactions.heat().dose(x, y);
    1.0 - (dose / DRY_J_PER_MM2).clamp(0.0, 1.0)
}

pub(super) fn burn(
    order: Res<ToolOrder>,
    mut tools: Query<(&Tool, &ToolMotion, &ToolContacts, &ToolState, &mut ToolWork)>,
    organs: Query<(&ReactionModel, &Organ)>,
    models: Res<Assets<OrganModel>>,
    mut touches: MessageWriter<OrganTouch>,
    mut seals: MessageWriter<TreatBleeders>,
) {
    for &entity in &order.0 {
        let Ok((tool, motion, contacts, state, mut work)) = tools.get_mut(entity) else { continue };
        if !matches!(tool.kind, ToolKind::CauteryHook(_)) {
            continue;
        }
        let mut does = ToolWork::Idle;
        if let (Some((cautery, coagulates)), Some(place)) = (power(tool, state), motion.to) {
            // The shaft is insulated.
            for contact in contacts.list.iter().filter(|contact| contact.part == ToolPart::Tip) {
                let heat = (cautery.power_w / LOUDEST_W).clamp(0.0, 1.0) as f32;
                match contact.matter {
                    ContactMatter::Organ { point, .. } => {
                        let Ok((reactions, organ)) = organs.get(contact.body) else { continue };
                        let water = models.get(&organ.0).map_or(1.0, |model| water(reactions, &model.atlas, point));
                        does = ToolWork::Burning { heat, water };
                        let action = ReactionAction::Cauterize(cautery);
                        touches.write(OrganTouch {
                            organ: contact.body,
                            point,
                            instrument: tool_number(entity),
                            action,
                        });
                    }
                    ContactMatter::Volume { .. } => {
                        does = ToolWork::Burning { heat, water: 0.5 };
                        if coagulates {
                            let (place_world_m, control) = (place.tip_in_world_m, BleedingControl::Cauterized);
                            seals.write(TreatBleeders { place_world_m, radius_m: SEAL_M, control });
                        }
                    }
                }
            }
        }
        work.set_if_neq(does);
    }
}
