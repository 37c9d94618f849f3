use bevy_surgery::organ::load::*;
use bevy_surgery::organ::clean::*;
#[test]
fn probe() {
    let dir = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/mesh/");
    for (f, node) in [("gallbladder.stl",None),("liver-smooth.obj",None),("liver-smoothUV.obj",None),("liver.obj",None),("liver2.obj",None),
      ("spleen-parts.glb",None),("spleen-parts.glb",Some("VH_M_spleen")),("spleen-parts.glb",Some("nope")),
      ("spleen-parts.glb",Some("VH_M_colic_surface_of_spleen")),("spleen-parts.glb",Some("VH_M_diaphragmatic_surface_of_spleen")),("spleen-parts.glb",Some("VH_M_gastric_surface_of_spleen")),("spleen-parts.glb",Some("VH_M_hilum_of_spleen")),("spleen-parts.glb",Some("VH_M_renal_surface_of_spleen"))] {
        let b = std::fs::read(format!("{dir}{f}")).unwrap();
        for (weld, topology) in [(Weld::ByPosition, Topology::Closed), (Weld::ByPositionAndUv, Topology::Any),(Weld::ByPosition, Topology::Any)] {
            let o = LoadOptions { unit: MeshUnit::Metres(0.01), node: node.map(str::to_string), weld, topology };
            let t = std::time::Instant::now();
            let r = parse_with(&b, f, &o, &mut |_| Err("no".into()));
            let t = t.elapsed();
            match r {
                Ok((m, r)) => println!("{f} {node:?} {weld:?} {topology:?}: v {} f {} area {} vol {} {r:?} {t:?}", m.positions_m.len(), m.triangles.len(), m.area_m2()*1e4, m.volume_m3()*1e6),
                Err(e) => println!("{f} {node:?} {weld:?} {topology:?}: {e}"),
            }
        }
    }
}
