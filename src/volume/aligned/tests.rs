use super::polygons::uva_of;
use super::*;
use crate::deform::DeformLattice;
use crate::deform::lattice::Patch;
use glam::{DVec3, Mat3, UVec3, Vec3};

/// A lattice with patches of several levels, all of whose free vertices are moved.
fn adaptive(most: f32) -> DeformLattice {
    let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 1).expect("a box");
    lattice.subdivide(Patch { level: 1, cell: UVec3::new(1, 0, 0) }).expect("a patch");
    lattice.subdivide(Patch { level: 2, cell: UVec3::new(2, 1, 1) }).expect("a patch");
    moved(lattice, most)
}

fn moved(mut lattice: DeformLattice, most: f32) -> DeformLattice {
    let wave = |at: DVec3| DVec3::new((at.y * 9.0).sin(), (at.z * 7.0 + 1.0).sin(), (at.x * 8.0 + 2.0).cos());
    lattice.set_from(|at| wave(at * 3.0) * f64::from(most)).expect("finite");
    lattice
}

#[test]
fn the_axis_that_the_view_looks_along_is_cut() {
    let step = 0.01;
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let mut along = Vec3::new(0.3, 0.25, -0.35);
            along[axis] = sign;
            let stack = SliceStack::new(along, Mat3::IDENTITY, step, Vec3::ZERO, Vec3::ONE);
            assert_eq!((stack.axis, stack.is_forward), (axis, sign > 0.0));
            assert_eq!(stack.count, 100);
            // From the eye away.
            let places: Vec<f32> = (0..stack.count).map(|n| stack.position(n)).collect();
            assert!(places.windows(2).all(|pair| ((pair[1] - pair[0]) * sign - step).abs() < 1e-5));
            assert!(places.iter().all(|place| (0.0..=1.0).contains(place)));
        }
    }
    // A box that is flat in the world is cut where its planes are met soonest.
    let flat = Mat3::from_diagonal(Vec3::new(1.0, 1.0, 10.0));
    let stack = SliceStack::new(Vec3::new(1.0, 0.0, 5.0), flat, step, Vec3::ZERO, Vec3::ONE);
    assert_eq!(stack.axis, 0);
}

#[test]
fn absurd_steps_give_no_more_slices_than_fit() {
    for step in [0.0, 1e-12, f32::NAN, f32::INFINITY] {
        let stack = SliceStack::new(Vec3::X, Mat3::IDENTITY, step, Vec3::splat(-0.5), Vec3::splat(1.5));
        assert!(stack.count <= MAX_SLICES, "{step}: {stack:?}");
    }
}

#[test]
fn polygons_tile_every_slice_without_gaps() {
    let lattice = adaptive(0.03);
    for margin in [0.0, 0.1] {
        let polygons = PatchPolygons::new(lattice.tree(), margin);
        for axis in 0..3 {
            for along in [0.01, 0.26, 0.499, 0.501, 0.77, 0.999] {
                // Their areas add up to the slice's, and every place is in one.
                let mut area = 0.0;
                for own in polygons.layers[axis][layer_of(&polygons, axis, along)].iter() {
                    if own.from <= along && along < own.to {
                        for rect in own.rects.clone() {
                            let rect = polygons.rects()[rect as usize];
                            area += (rect.high - rect.low).element_product();
                        }
                    }
                }
                let side = 1.0 + 2.0 * margin;
                assert!((area - side * side).abs() < 1e-4, "{area} across {axis} at {along}");
                for k in 0..400 {
                    let share = Vec3::new((k % 20) as f32, (k / 20) as f32, 0.0) / 20.0 + 0.013;
                    let uva = (share * side - margin).with_z(along);
                    assert!(polygons.rect_at(axis, uva).is_some(), "nothing across {axis} at {uva}");
                }
            }
        }
    }
}

fn layer_of(polygons: &PatchPolygons, axis: usize, along: f32) -> usize {
    let count = polygons.layers[axis].len() - 2;
    (along * count as f32) as usize + 1
}

#[test]
fn vertices_show_what_the_field_shows() {
    for lattice in [adaptive(0.05), moved(DeformLattice::new(Vec3::ZERO, Vec3::ONE, 3).expect("a box"), 0.02)] {
        let polygons = PatchPolygons::new(lattice.tree(), 0.25);
        for axis in 0..3 {
            for along in [-0.1, 0.03, 0.4, 0.62, 0.97, 1.2] {
                for k in 0..100 {
                    let uva = Vec3::new((k % 10) as f32 * 0.13 - 0.2, (k / 10) as f32 * 0.14 - 0.21, along);
                    let rect = polygons.rect_at(axis, uva).expect("there is one");
                    for n in 0..5 {
                        let vertex = polygons.vertex(rect, axis, along, lattice.translations(), n);
                        let field = lattice.rest_from_shown(vertex.place.as_dvec3()).as_vec3();
                        assert!((vertex.rest - field).length() < 1e-6, "{vertex:?} instead of {field}");
                    }
                }
            }
        }
    }
}

/// Figure 6: the polygon of a patch with one corner moved, as four triangles and as two.
#[test]
fn the_middle_vertex_brings_triangles_nearer_to_the_field() {
    let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 4).expect("a box");
    let vertex = lattice.tree().nearest_vertex(DVec3::splat(0.5));
    lattice.drag_vertex(vertex, Vec3::new(0.03, 0.02, 0.01)).expect("a free vertex");
    let polygons = PatchPolygons::new(lattice.tree(), 0.0);
    let (mut four, mut two) = (0.0_f64, 0.0_f64);
    let mut worst = 0.0_f64;
    for k in 0..4096 {
        let part = |bits: u32| 0.4376 + 0.125 * f64::from(k >> bits & 15) / 16.0;
        let place = DVec3::new(part(0), part(4), part(8));
        let exact = lattice.rest_from_shown(place);
        let translations = lattice.translations();
        let near = polygons.rest_in_triangles(2, place.as_vec3(), translations).expect("in the box");
        let error = (near.as_dvec3() - exact).length();
        four += error * error;
        worst = worst.max(error);
        // Two triangles without the middle.
        let uva = uva_of(place.as_vec3(), 2);
        let rect = polygons.rect_at(2, uva).expect("in the box");
        let PatchRect { low, high, .. } = polygons.rects()[rect as usize];
        let share = (uva.truncate() - low) / (high - low);
        let rest = |n| polygons.vertex(rect, 2, uva.z, translations, n).rest;
        let linear = if share.x + share.y < 1.0 {
            rest(0) + (rest(1) - rest(0)) * share.x + (rest(2) - rest(0)) * share.y
        } else {
            rest(3) + (rest(2) - rest(3)) * (1.0 - share.x) + (rest(1) - rest(3)) * (1.0 - share.y)
        };
        two += (linear.as_dvec3() - exact).length_squared();
    }
    println!("rms error with the middle {:.2e}, without {:.2e}", (four / 4096.0).sqrt(), (two / 4096.0).sqrt());
    assert!(four * 4.0 < two, "the middle vertex must at least halve the error: {four} against {two}");
    assert!(worst < 0.15 * 0.038, "{worst}");
}

#[test]
fn on_edges_of_polygons_triangles_are_the_field() {
    let lattice = adaptive(0.05);
    let polygons = PatchPolygons::new(lattice.tree(), 0.0);
    for k in 0..200 {
        // Edges of leaves are at multiples of their side.
        let place = Vec3::new(7.0 / LEAVES as f32, 0.003 + k as f32 * 0.0049, 0.37);
        let near = polygons.rest_in_triangles(2, place, lattice.translations()).expect("in the box");
        let exact = lattice.rest_from_shown(place.as_dvec3()).as_vec3();
        assert!((near - exact).length() < 2e-6, "{near} instead of {exact} at {place}");
    }
}
