//! Structures from colours, labels and thresholds: the real temporal bone against direct counts, and any input.

use crate::support::real_file;
use bevy_surgery::volume::error::VolumeFault;
use bevy_surgery::volume::structures::{Palette, SolidRamp, Structure, Structures, ThresholdBand, Thresholds, Tissue};
use bevy_surgery::volume::transfer::colours;
use bevy_surgery::volume::{Volume, VolumeGrid, Voxels};
use glam::{DVec3, IVec3, UVec3};
use proptest::prelude::*;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;

fn grid(size: UVec3) -> VolumeGrid {
    VolumeGrid::upright(size, DVec3::ONE)
}

fn volume(size: UVec3, voxels: Voxels) -> Volume {
    Volume::new(grid(size), voxels, 1.0, 0.0).expect("a small volume")
}

fn row(voxels: Voxels) -> Volume {
    volume(UVec3::new(voxels.count() as u32, 1, 1), voxels)
}

fn fault(result: Result<impl std::fmt::Debug, VolumeFault>) -> (String, String) {
    let VolumeFault::BadGrid { field, reason } = result.expect_err("must be refused") else {
        panic!("another kind of fault")
    };
    (field, reason)
}

/// The segmented temporal bone, as it lies in its files.
fn temporal_bone() -> Option<Volume> {
    let mut files: Vec<(u32, PathBuf)> = std::fs::read_dir(real_file("ct/temporal-bone-png")?)
        .expect("the folder can be listed")
        .filter_map(|entry| {
            let path = entry.expect("an entry").path();
            let number = path.file_stem()?.to_str()?.strip_prefix("plane")?.parse().ok()?;
            Some((number, path))
        })
        .collect();
    files.sort();
    let slices: Vec<Vec<[u8; 4]>> = files
        .par_iter()
        .map(|(_, path)| {
            let picture = image::open(path).expect("a listed file is a picture").to_rgba8();
            picture.pixels().map(|pixel| pixel.0).collect()
        })
        .collect();
    let size = UVec3::new(256, 256, files.len() as u32);
    let spacing = DVec3::new(49.2, 49.2, 48.5) / size.as_dvec3();
    Some(Volume::new(VolumeGrid::upright(size, spacing), Voxels::Rgba(slices.concat()), 1.0, 0.0).expect("a volume"))
}

/// The colours of overlapping segments in that data, each the sum of two colours of the palette modulo 256, and whose they are.
const OVERLAPS: [([u8; 3], &str, usize); 14] = [
    ([109, 178, 173], "Sinus and dura", 2085),
    ([215, 94, 42], "Internal carotid artery", 60),
    ([99, 70, 6], "Sinus and dura", 53),
    ([243, 136, 16], "Internal auditory canal", 52),
    ([90, 116, 55], "Bony labyrinth", 47),
    ([243, 208, 13], "Facial nerve", 45),
    ([90, 92, 86], "Vestibular aqueduct", 9),
    ([254, 185, 99], "Superior vestibular nerve", 5),
    ([120, 64, 244], "Inferior vestibular nerve", 4),
    ([150, 125, 249], "Chorda tympani", 3),
    ([218, 238, 16], "Cochlear nerve", 3),
    ([54, 111, 144], "Cochlear nerve", 2),
    ([79, 81, 140], "Facial nerve", 1),
    ([232, 249, 218], "Malleus", 1),
];

#[test]
fn the_real_temporal_bone_is_counted_voxel_by_voxel() {
    let Some(bone) = temporal_bone() else { return };
    let palette = Palette::temporal_bone();
    let (structures, report) = Structures::from_palette(&bone, &palette).expect("colours snap");
    let Voxels::Rgba(voxels) = bone.voxels() else { panic!("colours") };

    let mut colours: BTreeMap<[u8; 4], usize> = BTreeMap::new();
    voxels.iter().for_each(|&voxel| *colours.entry(voxel).or_default() += 1);
    let count = |colour: [u8; 3], opacity| {
        let [r, g, b] = colour;
        colours.get(&[r, g, b, opacity]).copied().unwrap_or(0)
    };
    for (colour, _, expected) in OVERLAPS {
        assert_eq!(count(colour, 254), expected, "{colour:?}");
    }
    let labelled = |label: u8| structures.labels().iter().filter(|&&other| other == label).count();
    for structure in &palette.structures {
        let overlapping: usize = OVERLAPS.iter().filter(|overlap| overlap.1 == structure.name).map(|o| o.2).sum();
        let expected = count(structure.colour, 255) + overlapping;
        assert!(expected > 0, "{} is missing", structure.name);
        assert_eq!(labelled(structures.label_of(&structure.name).unwrap()), expected, "{}", structure.name);
    }
    assert_eq!(labelled(0), count([0; 3], 0));
    assert_eq!(report.coloured, voxels.len() - count([0; 3], 0));
    assert_eq!((report.overlapping, report.off_palette), (2370, 0));
    assert_eq!(report.exact + report.overlapping, report.coloured);

    // What the list above claims, held against the place: odd voxels lie on the structure that they are said to belong to. (One
    // grain of the internal auditory canal lies apart from the rest of it.)
    let size = bone.grid().size;
    let is_odd = |index: &usize| voxels[*index][3] == 254;
    let lies_apart = |index: &usize| {
        let place = grid_place(*index, size);
        !neighbours(place, 2, size)
            .any(|near| voxels[near][3] == 255 && structures.labels()[near] == structures.labels()[*index])
    };
    let apart: Vec<IVec3> =
        (0..voxels.len()).filter(is_odd).filter(lies_apart).map(|index| grid_place(index, size)).collect();
    assert_eq!(apart, [IVec3::new(161, 62, 174)]);
    assert_eq!(Structures::for_volume(&bone).as_ref(), Ok(&structures), "recognised without being told");
    let (solid, opacity) = (structures.solid(), voxels.iter().map(|voxel| voxel[3]));
    assert!(solid.iter().copied().eq(opacity));
}

/// Places in memory of all voxels within some steps.
fn neighbours(place: IVec3, steps: i32, size: UVec3) -> impl Iterator<Item = usize> {
    let range = move || -steps..=steps;
    let cube = range().flat_map(move |z| range().flat_map(move |y| range().map(move |x| place + IVec3::new(x, y, z))));
    let inside = cube.filter(move |near| near.cmpge(IVec3::ZERO).all() && near.cmplt(size.as_ivec3()).all());
    inside.map(move |near| grid(size).index(near.as_uvec3()))
}

#[test]
fn colours_a_few_steps_off_go_to_the_nearest_and_far_ones_are_reported() {
    let palette = Palette::temporal_bone();
    let bone = [255, 249, 219];
    let voxels = vec![[255, 249, 219, 255], [250, 240, 210, 254], [240, 3, 250, 90], [60, 200, 10, 255], [9, 9, 9, 0]];
    let (structures, report) = Structures::from_palette(&row(Voxels::Rgba(voxels)), &palette).expect("colours");
    let name = |index: usize| structures.of_label(structures.labels()[index]).map(|s| s.name.as_str());
    assert_eq!((name(0), name(1), name(2), name(4)), (Some("Bone"), Some("Bone"), Some("Malleus"), None));
    assert!(name(3).is_some());
    assert_eq!((report.coloured, report.exact, report.overlapping, report.off_palette), (4, 1, 0, 1));
    assert_eq!(structures.solid(), [255, 254, 90, 255, 0]);
    assert_eq!(structures.list()[0].colour, bone);

    let empty = Palette::default();
    assert_eq!(fault(Structures::from_palette(&row(Voxels::Rgba(vec![[1; 4]])), &empty)).0, "palette");
    assert_eq!(fault(Structures::from_palette(&row(Voxels::U8(vec![1])), &palette)).0, "palette");
}

#[test]
fn bone_in_hounsfield_units_is_parted_by_density() {
    let values = vec![-1000, 100, 150, 250, 349, 350, 699, 700, 3000];
    let structures = Structures::for_volume(&row(Voxels::I16(values))).expect("bone");
    let (cortical, cancellous) =
        (structures.label_of("Cortical bone").unwrap(), structures.label_of("Cancellous bone").unwrap());
    let none = 0;
    assert_eq!(
        structures.labels(),
        [none, none, none, cancellous, cancellous, cancellous, cancellous, cortical, cortical]
    );
    assert_eq!(structures.solid()[..4], [0, 0, 0, 128]);
    assert!(structures.solid()[5..].iter().all(|&solid| solid == 255));
    let hardness = |label| structures.of_label(label).unwrap().hardness;
    assert!(hardness(cortical) > hardness(cancellous));
}

#[test]
fn every_kind_of_number_is_classified_alike() {
    let band = |from, to, name| ThresholdBand { from, to, structure: Structure::new(name, [1; 3], Tissue::Soft) };
    let thresholds = Thresholds {
        bands: vec![band(50.0, 100.0, "a"), band(150.0, 200.0, "b"), band(60.0, 300.0, "c")],
        solid: SolidRamp { empty_below: 20.0, full_above: 40.0 },
    };
    let stored: Vec<u8> = (0..=255).collect();
    let kinds = [
        Voxels::U8(stored.clone()),
        Voxels::I16(stored.iter().map(|&v| v.into()).collect()),
        Voxels::U16(stored.iter().map(|&v| v.into()).collect()),
        Voxels::F32(stored.iter().map(|&v| v.into()).collect()),
        Voxels::Rgba(stored.iter().map(|&v| [7, 7, 7, v]).collect()),
    ];
    let of_kind = kinds.map(|voxels| Structures::from_thresholds(&row(voxels), &thresholds).expect("thresholds"));
    assert!(of_kind.iter().all(|structures| *structures == of_kind[0]));
    let label = |value: usize| of_kind[0].labels()[value];
    // 20 is empty; 30 is nearest to the first band; of bands that overlap the first counts; 110 is only in the third.
    assert_eq!([20, 30, 60, 99, 110, 150, 199, 200, 255].map(label), [0, 1, 1, 1, 3, 2, 2, 3, 3]);

    // The same with a slope that turns the values round.
    let turned = Volume::new(grid(UVec3::new(256, 1, 1)), Voxels::U8(stored), -1.0, 255.0).expect("a volume");
    let turned = Structures::from_thresholds(&turned, &thresholds).expect("thresholds");
    assert!(turned.labels().iter().rev().eq(of_kind[0].labels()));

    let bad = |thresholds: &Thresholds| fault(Structures::from_thresholds(&row(Voxels::U8(vec![1])), thresholds)).0;
    assert_eq!(bad(&Thresholds::default()), "thresholds");
    let nan = Thresholds { bands: vec![band(f64::NAN, 1.0, "x")], ..thresholds.clone() };
    assert_eq!(bad(&nan), "thresholds");
    let falls = Thresholds { solid: SolidRamp { empty_below: 2.0, full_above: 1.0 }, ..thresholds };
    assert_eq!(bad(&falls), "solid");
}

#[test]
fn otsu_finds_a_bright_ball_in_noise() {
    let size = UVec3::splat(24);
    let ball = |index: usize| {
        let place = UVec3::new(index as u32 % 24, index as u32 / 24 % 24, index as u32 / 576);
        place.as_vec3().distance(glam::Vec3::splat(11.5)) < 7.0
    };
    let noise = |index: usize| (index.wrapping_mul(2_654_435_761) >> 7) as u16 % 60;
    let voxels = (0..13_824).map(|index| noise(index) + if ball(index) { 400 } else { 100 }).collect();
    let structures = Structures::for_volume(&volume(size, Voxels::U16(voxels))).expect("tissue");
    assert_eq!(structures.list()[0].name, "Tissue");
    for (index, (&label, &solid)) in structures.labels().iter().zip(structures.solid()).enumerate() {
        assert_eq!((label, solid), if ball(index) { (1, 255) } else { (0, 0) }, "voxel {index}");
    }
}

#[test]
fn label_volumes_name_their_voxels() {
    let size = UVec3::new(6, 1, 1);
    let ct = volume(size, Voxels::I16(vec![-1000, -450, 40, 60, 900, -800]));
    let labels = volume(size, Voxels::U16(vec![0, 5, 5, 17, 400, 400]));
    let liver = Structure::new("Liver", [150, 40, 40], Tissue::Soft);
    let absent = Structure::new("Spleen", [90, 40, 90], Tissue::Soft);
    let names = [(5, liver), (9, absent)];
    let structures = Structures::from_labels(&ct, &labels, &names, None).expect("labels");
    let listed: Vec<&str> = structures.list().iter().map(|structure| structure.name.as_str()).collect();
    assert_eq!(listed, ["Liver", "Spleen", "label 17", "label 400"]);
    assert_eq!(structures.labels(), [0, 1, 1, 3, 4, 4]);
    assert_eq!(structures.solid(), [0, 255, 255, 255, 255, 255]);
    let ramp = Structures::from_labels(&ct, &labels, &names, Some(SolidRamp::default())).expect("labels");
    assert_eq!(ramp.solid(), [0, 128, 255, 255, 255, 0]);
    let (a, b) = (structures.list()[2].colour, structures.list()[3].colour);
    assert!(a.iter().zip(b).map(|(a, b)| a.abs_diff(b)).max() > Some(40), "{a:?} and {b:?} look alike");
}

#[test]
fn label_volumes_that_do_not_fit_are_refused() {
    let size = UVec3::new(2, 2, 2);
    let ct = volume(size, Voxels::U8(vec![0; 8]));
    let from = |labels: &Volume| fault(Structures::from_labels(&ct, labels, &[], None));

    let (field, reason) = from(&volume(UVec3::new(2, 2, 3), Voxels::U8(vec![0; 12])));
    assert!(field == "labels" && reason.contains("[2, 2, 3]") && reason.contains("[2, 2, 2]"), "{reason}");
    let elsewhere = VolumeGrid::upright(size, DVec3::new(1.0, 1.0, 1.5));
    let (field, reason) = from(&Volume::new(elsewhere, Voxels::U8(vec![0; 8]), 1.0, 0.0).expect("a volume"));
    assert!(field == "labels" && reason.contains("mm"), "{reason}");
    assert!(from(&volume(size, Voxels::F32(vec![1.5; 8]))).1.contains("1.5"));
    assert!(from(&volume(size, Voxels::I16(vec![-3; 8]))).1.contains("-3"));
    assert!(from(&volume(size, Voxels::Rgba(vec![[1; 4]; 8]))).1.contains("palette"));
    let many = volume(UVec3::new(300, 1, 1), Voxels::U16((0..300).collect()));
    assert!(fault(Structures::from_labels(&many, &many, &[], None)).1.contains("299"));
    let one = || Structure::new("one", [1; 3], Tissue::Soft);
    let labels = volume(size, Voxels::U8(vec![1; 8]));
    assert!(fault(Structures::from_labels(&ct, &labels, &[(1, one()), (1, one())], None)).1.contains("taken"));
    assert!(fault(Structures::from_labels(&ct, &labels, &[(0, one())], None)).1.contains("taken"));
}

#[test]
fn coloured_volumes_without_a_known_palette_are_made_sense_of() {
    let size = UVec3::new(40, 40, 1);
    let (red, teal) = ([200, 30, 40, 255], [20, 130, 140, 255]);
    let two = (0..1600)
        .map(|index| {
            if index % 40 < 20 {
                red
            } else if index % 3 == 0 {
                teal
            } else {
                [0; 4]
            }
        })
        .collect();
    let structures = Structures::for_volume(&volume(size, Voxels::Rgba(two))).expect("two colours");
    let listed: Vec<&str> = structures.list().iter().map(|structure| structure.name.as_str()).collect();
    assert_eq!(listed, ["colour #c81e28", "colour #14828c"], "in descending order of voxels");
    assert_eq!((structures.labels()[0], structures.labels()[21]), (1, 2));

    // A photograph: every voxel another colour.
    let photograph = (0..1600usize).map(|i| [(i * 7 % 256) as u8, (i * 13 % 256) as u8, (i * 29 % 256) as u8, 255]);
    let photograph = volume(size, Voxels::Rgba(photograph.collect()));
    let structures = Structures::for_volume(&photograph).expect("a photograph");
    assert_eq!(structures.list().len(), 1);
    assert_eq!(structures.list()[0].name, "Tissue");
    let Voxels::Rgba(own) = photograph.voxels() else { panic!("colours") };
    assert_eq!(&colours(&photograph, Some(&structures)), own, "it keeps its own colours");
}

#[test]
fn colours_reach_two_voxels_into_what_is_empty() {
    let size = UVec3::new(13, 9, 11);
    let palette = [[10, 20, 30], [200, 100, 50], [70, 220, 90]];
    let list = palette.iter().map(|&colour| Structure::new("s", colour, Tissue::Soft)).collect();
    let count = grid(size).count();
    let labels: Vec<u8> = (0..count).map(|i| if i % 97 < 3 { (i % 3) as u8 + 1 } else { 0 }).collect();
    let solid = labels.iter().map(|&label| if label > 0 { 255 } else { 0 }).collect();
    let structures = Structures::new(list, labels.clone(), solid).expect("structures");
    let ct = volume(size, Voxels::I16(vec![0; count]));
    let painted = colours(&ct, Some(&structures));
    let place = |index: usize| grid_place(index, size);
    let mut dilated = 0;
    for (index, &[r, g, b, opacity]) in painted.iter().enumerate() {
        assert_eq!(opacity, 255);
        let own = [r, g, b];
        if labels[index] > 0 {
            assert_eq!(own, palette[usize::from(labels[index]) - 1]);
            continue;
        }
        let near: Vec<usize> = neighbours(place(index), 2, size).filter(|&near| labels[near] > 0).collect();
        let Some(&closest) = near.iter().min_by_key(|&&near| (place(near) - place(index)).length_squared()) else {
            continue;
        };
        dilated += 1;
        let allowed = |near: &&usize| palette[usize::from(labels[**near]) - 1] == own;
        assert!(near.iter().any(|near| allowed(&near)), "voxel {index} has the colour of none of its neighbours");
        let step = place(closest) - place(index);
        if step.abs().max_element() == 1 {
            let least = step.length_squared();
            let as_near = near.iter().filter(|&&near| (place(near) - place(index)).length_squared() == least);
            assert!(
                as_near.into_iter().any(|near| allowed(&near)),
                "voxel {index} has not its nearest neighbour's colour"
            );
        }
    }
    assert!(dilated > 500, "{dilated}");
}

fn grid_place(index: usize, size: UVec3) -> IVec3 {
    let [width, height, _] = size.to_array().map(|side| side as usize);
    IVec3::new((index % width) as i32, (index / width % height) as i32, (index / width / height) as i32)
}

#[test]
fn any_number_of_threads_gives_the_same_structures() {
    let size = UVec3::new(64, 64, 64);
    let voxels: Vec<[u8; 4]> =
        (0..64u32.pow(3)).map(|i| (i.wrapping_mul(2_654_435_761) & 0xF0F0_F0FF).to_le_bytes()).collect();
    let coloured = volume(size, Voxels::Rgba(voxels.clone()));
    let numbers = volume(size, Voxels::F32(voxels.iter().map(|v| f32::from(v[1]) * 0.01).collect()));
    let all = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let snapped = Structures::from_palette(&coloured, &Palette::temporal_bone()).expect("colours");
            let painted = colours(&coloured, Some(&snapped.0));
            (snapped, painted, Structures::for_volume(&coloured), Structures::for_volume(&numbers))
        })
    };
    assert!(all(1) == all(4));
}

#[test]
fn palettes_survive_a_file() {
    let palette = Palette::temporal_bone();
    let text = serde_json::to_string(&palette).expect("text");
    assert_eq!(serde_json::from_str::<Palette>(&text).expect("a palette"), palette);
    let critical = palette.structures.iter().filter(|structure| structure.is_critical).count();
    assert_eq!((palette.structures.len(), critical), (16, 13));
}

fn any_volume() -> impl Strategy<Value = Volume> {
    let size = (1u32..6, 1u32..6, 1u32..6).prop_map(|(x, y, z)| UVec3::new(x, y, z));
    let rescale = (prop_oneof![Just(1.0), Just(-2.5), Just(1e-6), Just(1e6)], -2000.0..2000.0f64);
    (size, rescale).prop_flat_map(|(size, (slope, intercept))| {
        let count = (size.x * size.y * size.z) as usize;
        let voxels = prop_oneof![
            prop::collection::vec(any::<u8>(), count).prop_map(Voxels::U8),
            prop::collection::vec(any::<i16>(), count).prop_map(Voxels::I16),
            prop::collection::vec(any::<u16>(), count).prop_map(Voxels::U16),
            prop::collection::vec(-1e30f32..1e30, count).prop_map(Voxels::F32),
            prop::collection::vec(any::<[u8; 4]>(), count).prop_map(Voxels::Rgba),
        ];
        voxels.prop_map(move |voxels| Volume::new(grid(size), voxels, slope, intercept).expect("a volume"))
    })
}

proptest! {
    #[test]
    fn any_volume_has_structures(volume in any_volume()) {
        let structures = Structures::for_volume(&volume).expect("no volume is refused");
        prop_assert_eq!(structures.labels().len(), volume.grid().count());
        for (&label, &solid) in structures.labels().iter().zip(structures.solid()) {
            prop_assert_eq!(label > 0, solid > 0, "a filled voxel belongs to something, an empty one to nothing");
        }
        prop_assert_eq!(colours(&volume, Some(&structures)).len(), volume.grid().count());
        prop_assert_eq!(colours(&volume, None).len(), volume.grid().count());
        // Labels may or may not be whole numbers: an error or structures, never a panic.
        let _ = Structures::from_labels(&volume, &volume, &[], None);
    }
}
