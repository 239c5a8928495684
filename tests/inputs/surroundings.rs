//! A region of the surroundings, and the material of the path.

use std::collections::BTreeMap;

use crate::kept::kept;
use beamlet::geometry::{check_clearance, load, swept};
use beamlet::scene::{Beam, Filter, Scene};
use beamlet::spectrum::nodes;

const BASE: &str = r#"detector = { distance = "1.8 m", pixels = [8, 8], pitch = "150 um" }
sample_mask = { distance = "1.2 m", material = "gold", thickness = "225 um", aperture = "20 um" }
[source]
distance = "1.21 m"
spot = "10 um"
spectrum = { anode = "tungsten", kvp = "60 kV", inherent_filters = [{ material = "Al", thickness = "1 mm" }] }
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.2 mm", height = "4 mm" } }
material = "carbon"
"#;

fn scene(keys: &str) -> beamlet::Result<Scene> {
    let text = format!("{BASE}\n[surroundings]\n{keys}\n");
    kept(&text, Scene::from_toml(&text, "tests/files"))
}

#[test]
fn a_region_is_the_object_that_stands_before_all_others() {
    let bath = "{ size = [\"4 mm\", \"6 mm\", \"8 mm\"] }";
    let region = scene(&format!(
        "material = \"water\"\npath_material = \"air\"\n\
         region = {{ box = {bath}, position = [\"0 mm\", \"1 mm\", \"0 mm\"] }}"
    ))
    .unwrap();
    let listed = BASE.replace(
        "[[object]]",
        &format!(
            "[surroundings]\nmaterial = \"air\"\npath_material = \"air\"\n\n[[object]]\n\
             name = \"surroundings\"\nshape = {{ box = {bath} }}\nmaterial = \"water\"\n\
             position = [\"0 mm\", \"1 mm\", \"0 mm\"]\n\n[[object]]"
        ),
    );
    let listed = Scene::from_toml(&listed, "tests/files").unwrap();
    assert_eq!(region.objects, listed.objects);
    assert_eq!(region.surroundings, "air");
    assert_eq!(region.region().unwrap().material, "water");
    assert!(listed.region().is_none());
    let sample = load(&region).unwrap();
    // The rod stands in the bath, and nothing says that a bath is larger than the detector sees.
    assert_eq!(sample.objects[1].inside, [Some(0)]);
    check_clearance(&region, &sample).unwrap();
    assert!(swept(&region, &sample).fov_warnings(&region).iter().all(|it| it.contains("\"rod\"")));
}

#[test]
fn regions_of_every_kind_come_back_from_the_resolved_scene() {
    for region in [
        "{ box = { size = [\"4 mm\", \"6 mm\", \"8 mm\"] } }",
        "{ cylinder = { radius = \"3 mm\", height = \"9 mm\" }, scale = 0.5 }",
        "{ cylinder = { radius = \"3 mm\", height = \"9 mm\", sides = 64 } }",
        "{ mesh = \"trimesh.obj\", unit = \"0.1 mm\", group = \"box\", rotate = [{ axis = [0, 0, 1], angle = \"30 deg\" }] }",
        "{ mesh = \"prusa-slicer.3mf\", scale = 0.1, center = true }",
    ] {
        let scene = scene(&format!("material = \"water\"\nregion = {region}")).unwrap();
        let volume = load(&scene).unwrap().objects[0].volume;
        assert!(volume > 1e-9, "{region}: {volume}");
        let text = scene.to_toml("tests/files", &BTreeMap::new(), &[]).unwrap();
        assert_eq!(Scene::from_toml(&text, "tests/files").unwrap(), scene, "{text}");
    }
    for keys in [
        "",
        "material = \"air\"",
        "path_material = \"air\"",
        "material = \"water\"\npath_material = \"air\"",
    ] {
        let scene = scene(keys).unwrap();
        let text = scene.to_toml("tests/files", &BTreeMap::new(), &[]).unwrap();
        assert_eq!(Scene::from_toml(&text, "tests/files").unwrap(), scene, "{text}");
    }
}

#[test]
fn the_path_hardens_a_spectrum_as_a_filter_of_its_length_does() {
    let plain = scene("material = \"vacuum\"").unwrap();
    let path = scene("material = \"vacuum\"\npath_material = \"air\"").unwrap();
    let mut filter = plain.clone();
    let Beam::Spectrum(spec) = &mut filter.source.beam else { panic!("a spectrum") };
    spec.filters.push(Filter::new("air", 1.8));
    let (path, filter) = (nodes(&path).unwrap(), nodes(&filter).unwrap());
    assert_eq!(path, filter);
    assert!(path.mean_energy() > nodes(&plain).unwrap().mean_energy());
    let told = nodes(&scene("material = \"vacuum\"\npath_material = \"airr\"").unwrap());
    let told = told.unwrap_err().to_string();
    assert!(told.contains("surroundings.path_material") && told.contains("\"air\""), "{told}");
    let told = nodes(&scene("material = \"vacuum\"\npath_material = \"gold\"").unwrap());
    let told = told.unwrap_err().to_string();
    assert!(told.contains("surroundings.path_material") && told.contains("lets nothing"), "{told}");
}
