//! The beam of a scene: one energy or a spectrum, its forms, overrides, and what is refused.

use std::collections::BTreeMap;

use crate::kept::kept;
use beamlet::Error;
use beamlet::scene::{Anode, Beam, Filter, Scene, SpectrumOrigin, SpectrumSpec};

/// A scene with these lines in `[source]`.
fn scene(lines: &str) -> Result<Scene, Error> {
    let text = format!(
        "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\n{lines}\n[detector]\ndistance = \"2 m\"\n\
         pixels = [4, 2]\npitch = \"100 um\"\n"
    );
    kept(&text, Scene::from_toml(&text, "."))
}

fn spectrum(lines: &str) -> SpectrumSpec {
    match scene(lines).unwrap().source.beam {
        Beam::Spectrum(spec) => spec,
        other => panic!("{other:?}"),
    }
}

const TUBE: &str = r#"spectrum = { anode = "tungsten", kvp = "60 kV", anode_angle = "20 deg", inherent_filters = [{ material = "Be", thickness = "0.2 mm" }], filters = [{ material = "Al", thickness = "1 mm" }, { material = "Cu", thickness = "50 um" }], nodes = 9 }"#;

#[test]
fn a_file_may_stand_alone_or_in_a_table() {
    let origin = SpectrumOrigin::File { path: "tube.csv".into() };
    let expected = SpectrumSpec::new(origin);
    assert_eq!(spectrum("spectrum = \"tube.csv\""), expected);
    assert_eq!(spectrum("spectrum = { file = \"tube.csv\" }"), expected);
}

#[test]
fn every_key_of_a_tube_is_read() {
    let filter = |material: &str, thickness| Filter::new(material, thickness);
    let origin = SpectrumOrigin::Tube {
        anode: Anode::Tungsten,
        kvp: 60.0,
        anode_angle: 20_f64.to_radians(),
        inherent_filters: vec![filter("Be", 0.2e-3)],
    };
    let filters = vec![filter("Al", 1e-3), filter("Cu", 50e-6)];
    assert_eq!(spectrum(TUBE), SpectrumSpec::new(origin).with_filters(filters).with_nodes(9));
    let short = spectrum("spectrum = { anode = \"molybdenum\", kvp = \"30 kV\" }");
    let SpectrumOrigin::Tube { anode, anode_angle, .. } = short.origin else { panic!("a file") };
    assert_eq!((anode, anode_angle.to_bits()), (Anode::Molybdenum, 12_f64.to_radians().to_bits()));
}

#[test]
fn the_resolved_scene_reads_back_equal() {
    for lines in [TUBE, "spectrum = \"tube.csv\"", "energy = \"30 keV\""] {
        let scene = scene(lines).unwrap();
        let text = scene.to_toml(".", &BTreeMap::new(), &[]).unwrap();
        assert_eq!(Scene::from_toml(&text, ".").unwrap(), scene, "{text}");
    }
}

#[test]
fn json_and_overrides_reach_the_beam() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("scene.json");
    let text = r#"{"source": {"distance": "1 m", "spot": "0 um", "energy": "30 keV"},
        "detector": {"distance": "2 m", "pixels": [4, 2], "pitch": "100 um"}}"#;
    std::fs::write(&path, text).unwrap();
    let beam = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        Scene::load_with(&path, &sets).map(|scene| scene.source.beam)
    };
    assert_eq!(beam(&[]).unwrap(), Beam::Energy(30.0));
    // An override of one drops the other that the file has.
    let tube = beam(&["source.spectrum.anode=tungsten", "source.spectrum.kvp=60kV"]).unwrap();
    assert!(matches!(&tube, Beam::Spectrum(spec) if spec.nodes.is_none()), "{tube:?}");
    let set = "source.spectrum={ file = \"a.csv\", nodes = 5 }";
    let file = beam(&[set, "source.spectrum.nodes=7"]).unwrap();
    assert!(matches!(&file, Beam::Spectrum(spec) if spec.nodes == Some(7)), "{file:?}");
}
