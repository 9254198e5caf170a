use screenmill::screen::{self, CellRange, Design, Profile, Scene};

fn scene(name: &str) -> Scene {
    let path = format!("{}/samples/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Scene::read(path.as_ref()).expect("a sample scene")
}

fn designed(profile: Profile) -> Design {
    let mut scene = scene("theatre");
    scene.microgeometry.profile = profile;
    let cells = CellRange { c0: 324, r0: 149, c1: 327, r1: 151 };
    screen::design(&scene, Some(cells), None, &|_, _| ()).expect("a design")
}

#[test]
fn the_polygons_of_a_cell_have_its_areas_and_cover_it_once() {
    for profile in [Profile::Bump, Profile::Dish] {
        let design = designed(profile);
        for cell in design.core_cells() {
            let mut covered = 0.0;
            for polygon in cell.polygons(design.cell_mm, profile) {
                let v = &polygon.vertices_mm;
                let area: f64 = (0..v.len())
                    .map(|k| {
                        let (a, b) = (v[k], v[(k + 1) % v.len()]);
                        0.5 * (a[0] * b[1] - a[1] * b[0])
                    })
                    .sum();
                let wanted = cell.facets[polygon.facet].area_mm2;
                assert!((area / wanted - 1.0).abs() < 1.1e-6, "{} {area} {wanted}", polygon.facet);
                covered += area;
            }
            assert!((covered - 16.0).abs() < 1e-12);
        }
    }
}
