//! Lesions of organs: touched, coagulated, and what was burnt beside them.

use super::scene::Scene;
use crate::organ::atlas::texel_at;
use crate::organ::surface::Surface;
use crate::organ::{OrganModel, SurfacePoint};
use crate::reactions::ReactionModel;
use crate::scenario::Lesion;
use crate::scenario::judge::LesionFacts;
use bevy::prelude::*;
use glam::DVec3;

/// Heat per area from which tissue counts as coagulated, J/mm2: where the default burns are half opaque.
const COAGULATED_J_PER_MM2: f32 = 0.32;
/// How often what was burnt is measured, steps.
const EVERY_STEPS: u64 = 15;

/// Lesions of one organ.
#[derive(Clone)]
pub(super) struct WatchedLesions {
    organ: Entity,
    lesions: Vec<Area>,
    /// Texels of the organ's map that are in a lesion, or whose burn has been counted: a bit each.
    counted: Vec<u64>,
    last: LesionFacts,
}

/// A lesion's place, and its texels with their areas, mm².
#[derive(Clone)]
struct Area {
    middle: SurfacePoint,
    radius_m: f32,
    texels: Vec<(u32, u32, f32)>,
}

impl WatchedLesions {
    /// None where the organ does not react, or a lesion is not on it.
    pub fn new(organ: Entity, lesions: &[Lesion], scene: &Scene) -> Option<Self> {
        let (model, surface, reactions) = parts(organ, scene)?;
        let size = reactions.size();
        let areas: Vec<Area> = lesions
            .iter()
            .map(|lesion| area(lesion, model, &surface, size.width_px, size.height_px))
            .collect::<Option<_>>()?;
        let mut counted = vec![0; (size.width_px as usize * size.height_px as usize).div_ceil(64)];
        for &(x, y, _) in areas.iter().flat_map(|area| &area.texels) {
            mark(&mut counted, size.width_px, x, y);
        }
        let last =
            LesionFacts { is_touched: vec![false; areas.len()], coagulated: vec![0.0; areas.len()], outside_mm2: 0.0 };
        Some(Self { organ, lesions: areas, counted, last })
    }

    /// Bytes that it holds, about.
    pub fn bytes(&self) -> usize {
        let texels = self.lesions.iter().map(|area| size_of_val(area.texels.as_slice()));
        size_of_val(self.counted.as_slice()) + texels.sum::<usize>()
    }

    /// Looks at a step.
    pub fn look(&mut self, step: u64, scene: &Scene) -> LesionFacts {
        let Some((model, surface, reactions)) = parts(self.organ, scene) else { return self.last.clone() };
        let Ok((.., transform)) = scene.organs.get(self.organ) else { return self.last.clone() };
        let organ_from_world = transform.affine().inverse();
        let tips: Vec<DVec3> = scene
            .tools
            .iter()
            .filter_map(|(.., contacts, _)| contacts.of(self.organ, crate::tools::ToolPart::Tip))
            .map(|contact| organ_from_world.transform_point3(contact.point_world_m).as_dvec3())
            .collect();
        for (is_touched, area) in self.last.is_touched.iter_mut().zip(&self.lesions) {
            let middle_m = surface.position_m(area.middle);
            *is_touched = tips.iter().any(|tip_m| tip_m.distance(middle_m) <= f64::from(area.radius_m));
        }
        if step.is_multiple_of(EVERY_STEPS) {
            let heat = reactions.heat();
            for (coagulated, area) in self.last.coagulated.iter_mut().zip(&self.lesions) {
                let is_burnt = |x: u32, y: u32| heat.dose(x, y) >= COAGULATED_J_PER_MM2;
                let burnt: f32 = area.texels.iter().filter(|(x, y, _)| is_burnt(*x, *y)).map(|(.., mm2)| mm2).sum();
                *coagulated = burnt / area.texels.iter().map(|(.., mm2)| mm2).sum::<f32>().max(1e-9);
            }
            let size = reactions.size();
            for (x, y) in heat.burnt(COAGULATED_J_PER_MM2) {
                if mark(&mut self.counted, size.width_px, x, y) {
                    self.last.outside_mm2 += texel_mm2(model, &surface, x, y, size.width_px, size.height_px);
                }
            }
        }
        self.last.clone()
    }
}

/// Notes a texel; whether it was not noted before.
fn mark(counted: &mut [u64], width: u32, x: u32, y: u32) -> bool {
    let at = y as usize * width as usize + x as usize;
    let Some(word) = counted.get_mut(at / 64) else { return false };
    let bit = 1 << (at % 64);
    let is_new = *word & bit == 0;
    *word |= bit;
    is_new
}

fn parts<'a>(organ: Entity, scene: &'a Scene) -> Option<(&'a OrganModel, Surface<'a>, &'a ReactionModel)> {
    let (_, _, handle, Some(shape), _, Some(reactions), _) = scene.organs.get(organ).ok()? else { return None };
    let model = scene.models.as_ref()?.get(&handle.0).filter(|model| shape.is_of(model))?;
    Some((model, model.surface(shape), reactions))
}

fn uv_of(x: u32, y: u32, width: u32, height: u32) -> glam::DVec2 {
    glam::DVec2::new((f64::from(x) + 0.5) / f64::from(width), (f64::from(y) + 0.5) / f64::from(height))
}

fn texel_mm2(model: &OrganModel, surface: &Surface, x: u32, y: u32, width: u32, height: u32) -> f32 {
    let Some(point) = model.atlas.locate_uv(uv_of(x, y, width, height), &model.table) else { return 0.0 };
    let mm2 = surface.frame(point).texel_area_m2(width, height) * 1e6;
    if mm2.is_finite() { mm2 as f32 } else { 0.0 }
}

/// The texels of a lesion: those whose middles are within its radius of its middle. They are found by going outwards, so that a
/// lesion may lie over the map's seam.
fn area(lesion: &Lesion, model: &OrganModel, surface: &Surface, width: u32, height: u32) -> Option<Area> {
    let middle = model.atlas.locate_uv(lesion.uv.as_dvec2(), &model.table)?;
    let middle_m = surface.position_m(middle);
    let is_within = |x: u32, y: u32| {
        let point = model.atlas.locate_uv(uv_of(x, y, width, height), &model.table);
        point.is_some_and(|at| surface.position_m(at).distance(middle_m) <= f64::from(lesion.radius_m))
    };
    let start = texel_at(lesion.uv.as_dvec2(), width, height);
    let mut seen = std::collections::BTreeSet::from([start]);
    let mut next = vec![start];
    let mut texels = Vec::new();
    while let Some((x, y)) = next.pop() {
        if (x, y) != start && !is_within(x, y) {
            continue;
        }
        texels.push((x, y, texel_mm2(model, surface, x, y, width, height)));
        // A map that is not wound round a sphere has nothing beyond its sides, which the surface says.
        let beside = [((x + 1) % width, y), ((x + width - 1) % width, y), (x, y + 1), (x, y.wrapping_sub(1))];
        next.extend(beside.into_iter().filter(|(x, y)| *y < height && seen.insert((*x, *y))));
    }
    texels.sort_by_key(|(x, y, _)| (*y, *x));
    Some(Area { middle, radius_m: lesion.radius_m, texels })
}
