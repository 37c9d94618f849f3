//! Transfer functions: opacity that does not depend on the step, tables that follow their points, presets.

use bevy_surgery::volume::phantom::{PhantomOptions, phantom};
use bevy_surgery::volume::structures::{Structures, Thresholds};
use bevy_surgery::volume::transfer::{ColourSource, ControlPoint, TABLE_ENTRIES, TransferFunction, ValueScale};
use bevy_surgery::volume::{Volume, VolumeGrid, Voxels};
use glam::{DVec3, UVec3};
use proptest::prelude::*;

fn presets() -> [(&'static str, TransferFunction); 8] {
    [
        ("default", TransferFunction::default()),
        ("bone", TransferFunction::bone()),
        ("soft tissue", TransferFunction::soft_tissue()),
        ("vessels", TransferFunction::vessels()),
        ("head", TransferFunction::head()),
        ("labelled", TransferFunction::labelled()),
        ("structures", TransferFunction::structures()),
        ("window", TransferFunction::window(40.0, 400.0)),
    ]
}

const HU: [f64; 2] = [-1000.0, 3000.0];

fn opacity(function: &TransferFunction, range: [f64; 2], value: f64) -> f32 {
    function.bake(range, 1e-3).entry(((value - range[0]) / (range[1] - range[0])) as f32)[3]
}

#[test]
fn presets_show_what_they_are_named_after() {
    for (name, function) in presets() {
        let range = match function.scale {
            ValueScale::Values => [-1000.0, 2000.0],
            ValueScale::ShareOfRange => [0.0, 1.0],
        };
        let table = function.bake(range, 0.2e-3);
        assert_eq!(table.entries()[0][3], 0.0, "{name}: the least value is invisible");
        assert!(table.entries()[TABLE_ENTRIES - 1][3] > 0.15, "{name}: the greatest value is visible");
        assert_eq!(function.sorted_points(), function.points, "{name}: its points are in order");
        let text = serde_json::to_string(&function).expect("text");
        assert_eq!(serde_json::from_str::<TransferFunction>(&text).expect("a function"), function, "{name}");
    }
    let (air, muscle, contrast, bone) = (-1000.0, 50.0, 300.0, 1500.0);
    let shown = |function: TransferFunction| [air, muscle, contrast, bone].map(|value| opacity(&function, HU, value));
    let of_bone = shown(TransferFunction::bone());
    assert!(of_bone[0] == 0.0 && of_bone[1] == 0.0 && of_bone[3] > 0.99, "{of_bone:?}");
    let soft = shown(TransferFunction::soft_tissue());
    assert!(soft[0] == 0.0 && soft[1] > 0.05 && soft[1] < 0.3 && soft[3] > 0.8, "{soft:?}");
    let vessels = shown(TransferFunction::vessels());
    assert!(vessels[1] == 0.0 && vessels[2] > 0.6, "{vessels:?}");
    let structures = shown(TransferFunction::structures());
    assert!(structures[0] == 0.0 && structures[1] > 0.95, "{structures:?}");
    let brain = opacity(&TransferFunction::head(), [0.0, 1.0], 0.35);
    let skull = opacity(&TransferFunction::head(), [0.0, 1.0], 0.6);
    assert!(brain == 0.0 && skull > 0.9, "{brain} {skull}");
}

#[test]
fn every_volume_gets_the_function_that_suits_it() {
    let of = |voxels: Voxels| {
        let grid = VolumeGrid::upright(UVec3::new(voxels.count() as u32, 1, 1), DVec3::ONE);
        Volume::new(grid, voxels, 1.0, 0.0).expect("a volume")
    };
    let for_volume = |voxels| TransferFunction::for_volume(&of(voxels));
    assert_eq!(for_volume(Voxels::Rgba(vec![[1; 4]; 2])), TransferFunction::labelled());
    assert_eq!(for_volume(Voxels::I16(vec![-1000, 2000])), TransferFunction::bone());
    assert_eq!(for_volume(Voxels::F32(vec![0.0, 0.99])), TransferFunction::head());
    let bright = of(Voxels::U16(vec![0, 1300]));
    let surface = TransferFunction::for_volume(&bright);
    assert_eq!(surface, TransferFunction::surface(&Thresholds::otsu(&bright).solid));
    let table = surface.bake(bright.range(), 1e-3);
    let [dark, bright] = [0.0, 1.0].map(|share| table.entry(share)[3]);
    assert!(dark == 0.0 && bright > 0.9, "the darker voxel is empty, the brighter one is not: {dark} {bright}");
    assert_eq!(for_volume(Voxels::U8(vec![7, 7])), TransferFunction::default());

    let ct = of(Voxels::I16(vec![-1000, 2000]));
    let bones = Structures::from_thresholds(&ct, &Thresholds::bone_hu()).expect("bones");
    let named = ct.with_structures(bones).expect("the same grid");
    assert_eq!(TransferFunction::for_volume(&named), TransferFunction::bone(), "nothing critical, nothing soft");
    let phantom = phantom(&PhantomOptions { size: 32, ..Default::default() }).expect("a phantom");
    assert_eq!(TransferFunction::for_volume(&phantom), TransferFunction::structures());
    assert_eq!(TransferFunction::structures().colour_source, ColourSource::Voxels);
}

#[test]
fn opaque_stays_opaque_and_steps_that_are_none_count_as_the_reference() {
    let point = |value, opacity| ControlPoint { value, colour: [255; 3], opacity };
    let function = TransferFunction {
        points: vec![point(0.0, 0.5), point(1.0, 1.0)],
        scale: ValueScale::ShareOfRange,
        reference_length_m: 2e-3,
        ..Default::default()
    };
    let ends = |step_m| {
        let table = function.bake([0.0, 1.0], step_m);
        [table.entries()[0][3], table.entries()[TABLE_ENTRIES - 1][3]]
    };
    assert_eq!(ends(2e-3), [0.5, 1.0]);
    assert_eq!(ends(1e-9)[1], 1.0);
    assert!((ends(4e-3)[0] - 0.75).abs() < 1e-6);
    for none in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(ends(none), [0.5, 1.0]);
    }
    let unusable = TransferFunction { reference_length_m: f64::NAN, ..function.clone() };
    assert_eq!(unusable.usable_reference_length_m(), 1e-3);
    let invisible = |function: &TransferFunction, range| {
        function.bake(range, 1e-3).entries().iter().all(|entry| entry[3] == 0.0 && entry.iter().all(|c| c.is_finite()))
    };
    assert!(invisible(&function, [0.0, f64::NAN]));
    assert!(invisible(&TransferFunction { points: Vec::new(), ..function.clone() }, [0.0, 1.0]));
    assert!(invisible(&TransferFunction::window(f64::NAN, 1.0), [0.0, 1.0]));
    assert!(invisible(&TransferFunction::window(0.5, f64::NAN), [0.0, 1.0]));
    // A window without a width is a step.
    let step = TransferFunction::window(0.5, 0.0).bake([0.0, 1.0], 1e-3);
    assert_eq!([0.49, 0.51].map(|share| step.entry(share)[3]), [0.0, 1.0]);
}

fn any_point() -> impl Strategy<Value = ControlPoint> {
    let number = prop_oneof![4 => -2.0..3.0f64, 1 => any::<f64>()];
    let opacity = prop_oneof![4 => -0.5..1.5f32, 1 => any::<f32>()];
    (number, any::<[u8; 3]>(), opacity).prop_map(|(value, colour, opacity)| ControlPoint { value, colour, opacity })
}

fn any_function() -> impl Strategy<Value = TransferFunction> {
    let scale = prop_oneof![Just(ValueScale::Values), Just(ValueScale::ShareOfRange)];
    (prop::collection::vec(any_point(), 0..12), scale, prop_oneof![Just(1e-3), any::<f64>()]).prop_map(
        |(points, scale, reference_length_m)| TransferFunction {
            points,
            scale,
            reference_length_m,
            colour_source: ColourSource::Points,
        },
    )
}

proptest! {
    #[test]
    fn any_points_make_a_usable_table(function in any_function(), step_m in any::<f64>(), range in any::<[f64; 2]>()) {
        for range in [range, [0.0, 1.0], [1.0, 0.0], [0.0, 0.0]] {
            let table = function.bake(range, step_m);
            prop_assert_eq!(table.entries().len(), TABLE_ENTRIES);
            for entry in table.entries() {
                prop_assert!(entry.iter().all(|channel| (0.0..=1.0).contains(channel)), "{:?}", entry);
            }
            let greatest = table.entries().iter().map(|entry| entry[3]).fold(0.0, f32::max);
            prop_assert_eq!(table.greatest_opacity(0.0..=1.0), greatest);
        }
    }

    #[test]
    fn two_half_steps_are_one_step(function in any_function(), step_m in 1e-5..5e-3f64) {
        let function = TransferFunction { reference_length_m: 1e-3, ..function };
        let (whole, half) = (function.bake([0.0, 1.0], step_m), function.bake([0.0, 1.0], 0.5 * step_m));
        for (whole, half) in whole.entries().iter().zip(half.entries()) {
            let twice = 1.0 - (1.0 - f64::from(half[3])).powi(2);
            prop_assert!((twice - f64::from(whole[3])).abs() < 1e-5, "{} {}", twice, whole[3]);
            prop_assert_eq!(whole[..3].to_vec(), half[..3].to_vec());
        }
    }

    #[test]
    fn rising_points_make_a_rising_table(mut opacities in prop::collection::vec(0.0..=1.0f32, 2..8)) {
        opacities.sort_by(f32::total_cmp);
        let last = (opacities.len() - 1) as f64;
        let points = opacities.iter().enumerate().map(|(place, &opacity)| ControlPoint {
            value: place as f64 / last,
            colour: [(30 * place) as u8; 3],
            opacity,
        });
        let function = TransferFunction { points: points.collect(), ..Default::default() };
        let table = function.bake([-5.0, 7.0], 0.4e-3);
        for pair in table.entries().windows(2) {
            prop_assert!(pair[0].iter().zip(&pair[1]).all(|(before, after)| before <= after), "{:?}", pair);
        }
    }

    #[test]
    fn the_order_of_points_does_not_matter(points in prop::collection::vec(any_point(), 0..10), seed in any::<u64>()) {
        // Without two points at one value, whose order makes a step.
        let mut points = points;
        points.sort_by(|a, b| a.value.total_cmp(&b.value));
        points.dedup_by(|a, b| a.value == b.value);
        let mut shuffled = points.clone();
        let count = shuffled.len().max(1);
        (0..shuffled.len()).for_each(|place| shuffled.swap(place, (seed as usize).wrapping_mul(place + 7) % count));
        let bake = |points| TransferFunction { points, ..Default::default() }.bake([0.0, 1.0], 1e-3);
        prop_assert_eq!(bake(points), bake(shuffled));
    }
}
