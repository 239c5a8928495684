//! 3MF files: parts of the archive, name spaces, extensions, units, components and roles.

use super::formats::{
    TRIANGLES, VERTICES, archive, archive_of, model, model_text, read, refused, tetrahedron,
};
use super::set_up::close;

const CORE: &str = "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"";

const ITEM: &str = "<item objectid=\"1\"/>";

/// Volume of a 3MF file in sixths of a unit, and its warnings.
fn sixths(bytes: &[u8]) -> (f64, String) {
    let sample = read("a.3mf", bytes, None).unwrap();
    (6e9 * sample.objects[0].volume, sample.objects[0].warnings.join("\n"))
}

/// Elements and attributes of other name spaces, with the names of elements of the core.
#[test]
fn elements_of_a_3mf_count_by_their_name_space() {
    let slices = "<s:slicestack id=\"9\"><s:slice ztop=\"1\"><s:vertices><s:vertex x=\"0\" y=\"0\"/>\
                  </s:vertices></s:slice></s:slicestack>";
    let vendor = "<v:note><item objectid=\"1\"/></v:note><v:item objectid=\"1\"/>\
                  <u:item objectid=\"1\"/>";
    let spaces = "xmlns:s=\"http://schemas.microsoft.com/3dmanufacturing/slice/2015/07\" \
                  xmlns:v=\"http://vendor.example/2020\" v:unit=\"mile\"";
    let leaf = tetrahedron("id=\"1\" v:id=\"8\" v:type=\"other\" s:slicestackid=\"9\"");
    let build = format!("{ITEM}{vendor}");
    let (volume, warnings) =
        sixths(&model(&format!("{CORE} {spaces}"), &format!("{slices}{leaf}"), &build));
    assert!(close(volume, 1.0, 1e-9) && warnings.is_empty(), "{volume}: {warnings}");
    // The core may have a prefix.
    let prefixed = model_text(&format!("{CORE} {spaces}"), &leaf, ITEM);
    let prefixed = ["model", "resources", "object", "mesh", "vert", "triangle", "build", "item"]
        .iter()
        .fold(prefixed.replace("xmlns=", "xmlns:c="), |text, name| {
            text.replace(&format!("<{name}"), &format!("<c:{name}"))
                .replace(&format!("</{name}"), &format!("</c:{name}"))
        });
    assert!(close(sixths(&archive(&prefixed)).0, 1.0, 1e-9));
    let coarse = leaf.replace("s:slicestackid", "s:meshresolution=\"lowres\" s:slicestackid");
    let message = refused("a.3mf", &model(&format!("{CORE} {spaces}"), &coarse, ITEM));
    assert!(message.contains("the object 1 has slices"), "{message}");
}

#[test]
fn required_extensions_of_a_3mf_that_change_its_geometry_are_refused_by_name() {
    let lattice = "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02";
    let beams = "<b:beamlattice radius=\"1\"><b:beams><b:beam v1=\"0\" v2=\"1\"/></b:beams></b:beamlattice>";
    let leaf = tetrahedron("id=\"1\"").replace("</mesh>", &format!("{beams}</mesh>"));
    let spaces = format!("{CORE} xmlns:b=\"{lattice}\"");
    let required = |spaces: &str, prefixes: &str| {
        model(&format!("{spaces} requiredextensions=\"{prefixes}\""), &leaf, ITEM)
    };
    assert!(refused("a.3mf", &required(&spaces, "b")).contains(lattice));
    let message = refused("a.3mf", &required(&spaces, "q"));
    assert!(message.contains("\"q\", which has no name space"), "{message}");
    // Where a reader may go on without it, it is said.
    let (volume, warnings) = sixths(&model(&spaces, &leaf, ITEM));
    assert!(close(volume, 1.0, 1e-9) && warnings.contains("beamlattice of \"1\""), "{warnings}");
    let plain = format!(
        "{spaces} xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\" \
         xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\""
    );
    assert!(close(sixths(&required(&plain, "p m")).0, 1.0, 1e-9));
}

#[test]
fn only_the_model_of_a_3mf_is_read_and_the_rest_is_said() {
    let leaf = tetrahedron("id=\"1\"");
    let other = |kind: &str| tetrahedron(&format!("id=\"2\" name=\"extra\" {kind}"));
    let two = "<item objectid=\"1\"/><item objectid=\"2\" transform=\"1 0 0 0 1 0 0 0 1 3 0 0\"/>";
    let (volume, _) = sixths(&model(CORE, &format!("{leaf}{}", other("type=\"model\"")), two));
    assert!(close(volume, 2.0, 1e-9));
    let setting = |name: &str, text: &str| {
        let data =
            format!("<metadatagroup><metadata name=\"{name}\">{text}</metadata></metadatagroup>");
        other("").replace("<mesh>", &format!("{data}<mesh>"))
    };
    for extra in [
        other("type=\"support\""),
        other("type=\"solidsupport\""),
        other("type=\"other\""),
        other("type=\"surface\""),
        setting("cura:support_mesh", "True"),
        setting("cura:infill_mesh", "true"),
    ] {
        let (volume, warnings) = sixths(&model(CORE, &format!("{leaf}{extra}"), two));
        let said = warnings.contains("left out of the file: \"extra\"");
        assert!(close(volume, 1.0, 1e-9) && said, "{volume}: {warnings}");
        let alone = refused("a.3mf", &model(CORE, &extra, "<item objectid=\"2\"/>"));
        assert!(alone.contains("nothing is left of its objects: \"extra\""), "{alone}");
    }
    let (volume, _) =
        sixths(&model(CORE, &format!("{leaf}{}", setting("cura:support_mesh", "False")), two));
    assert!(close(volume, 2.0, 1e-9));
    let message = refused("a.3mf", &model(CORE, &other("type=\"odd\""), two));
    assert!(message.contains("type is \"odd\""), "{message}");
}

/// Modifiers and negative volumes by the settings of slicers: ranges of triangles of an object, or its
/// components.
#[test]
fn roles_of_slicers_in_a_3mf_are_left_out_and_said() {
    let shifted = VERTICES
        .replace("<vertices>", "")
        .replace("x=\"0\"", "x=\"4\"")
        .replace("x=\"1\"", "x=\"5\"");
    let vertices = VERTICES.replace("</vertices>", "") + &shifted;
    let second = [("\"0\"", "\"4\""), ("\"1\"", "\"5\""), ("\"2\"", "\"6\""), ("\"3\"", "\"7\"")];
    let second =
        second.iter().fold(TRIANGLES.to_owned(), |text, (from, to)| text.replace(from, to));
    let both = format!(
        "<object id=\"1\" name=\"part\"><mesh>{vertices}<triangles>{TRIANGLES}{second}</triangles>\
         </mesh></object>"
    );
    let text = model_text(CORE, &both, ITEM);
    let settings = |kind: &str| {
        format!(
            "<config><object id=\"1\"><volume firstid=\"0\" lastid=\"3\"><metadata type=\"volume\" \
             key=\"volume_type\" value=\"ModelPart\"/></volume><volume firstid=\"4\" lastid=\"7\">\
             <metadata type=\"volume\" key=\"volume_type\" value=\"{kind}\"/></volume></object></config>"
        )
    };
    let with = |text: &str, name: &str, settings: &str| {
        sixths(&archive_of(&[("3D/3dmodel.model", text), (name, settings)]))
    };
    let prusa = "Metadata/Slic3r_PE_model.config";
    assert!(close(with(&text, prusa, &settings("ModelPart")).0, 2.0, 1e-9));
    for (kind, words) in [
        ("NegativeVolume", "a negative volume of a slicer: its hole is not cut"),
        ("ParameterModifier", "modifies settings"),
        ("SupportBlocker", "support"),
    ] {
        let (volume, warnings) = with(&text, prusa, &settings(kind));
        let said = warnings.contains("triangles 4 to 7 of \"part\"") && warnings.contains(words);
        assert!(close(volume, 1.0, 1e-9) && said, "{kind}: {volume}: {warnings}");
    }
    let pair = "<object id=\"8\" name=\"pair\"><components><component objectid=\"1\"/>\
                <component objectid=\"2\" transform=\"1 0 0 0 1 0 0 0 1 3 0 0\"/></components></object>";
    let leaves = tetrahedron("id=\"1\"") + &tetrahedron("id=\"2\"") + pair;
    let text = model_text(CORE, &leaves, "<item objectid=\"8\"/>");
    for (kind, volume) in [("normal_part", 2.0), ("negative_part", 1.0), ("support_enforcer", 1.0)]
    {
        let settings = format!(
            "<config><object id=\"8\"><part id=\"1\" subtype=\"normal_part\"></part>\
             <part id=\"2\" subtype=\"{kind}\"></part></object></config>"
        );
        let (found, warnings) = with(&text, "Metadata/model_settings.config", &settings);
        let said = warnings.contains("component 2 of \"pair\"");
        assert!(
            close(found, volume, 1e-9) && said == (volume < 2.0),
            "{kind}: {found}: {warnings}"
        );
    }
}

#[test]
fn parts_of_a_3mf_are_found_by_any_spelling_of_their_names() {
    let text = model_text(CORE, &tetrahedron("id=\"1\""), ITEM);
    let relations = |target: &str| {
        format!(
            "<Relationships><Relationship Target=\"{target}\" Id=\"r\" \
             Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>"
        )
    };
    for (name, target) in [
        ("3D\\3dmodel.model", "/3D/3dmodel.model"),
        ("3D/3dmodel.model", "\\3D\\3dmodel.model"),
        ("3D/part.xml", "/3D/part.xml"),
        ("3D/PART.MODEL", "3d/part.model"),
    ] {
        let relations = relations(target);
        for rels in ["_rels/.rels", "_rels\\.rels"] {
            let marked = format!("\u{feff}{text}");
            let (volume, _) = sixths(&archive_of(&[(name, &marked), (rels, &relations)]));
            assert!(close(volume, 1.0, 1e-9), "{name}");
        }
    }
}

#[test]
fn a_3mf_has_its_unit_components_and_materials() {
    let base = "<basematerials id=\"7\"><base name=\"brass\" displaycolor=\"#ffffff\"/>\
                <base name=\"resin\" displaycolor=\"#ffffff\"/></basematerials>";
    let leaf = tetrahedron("id=\"1\" name=\"leaf\" pid=\"7\" pindex=\"1\"");
    let pair = "<object id=\"2\" name=\"pair\"><components>\n<component objectid=\"1\"/>\
                <component objectid=\"1\" transform=\"-2 0 0 0 2 0 0 0 2 -1 5 7\"/></components></object>";
    let item = "<item objectid=\"2\" transform=\"1 0 0 0 1 0 0 0 1 0 0 -3\"/>";
    for (unit, length) in [("unit=\"micron\"", 1e-6_f64), ("", 1e-3), ("unit=\"inch\"", 25.4e-3)] {
        let file = model(unit, &format!("{base}{leaf}{pair}"), item);
        let sample = read("a.3mf", &file, Some("resin")).unwrap();
        let object = &sample.objects[0];
        // The second is mirrored and twice as large: 8 times the volume, and not inside out.
        assert!(close(object.volume, 9.0 / 6.0 * length.powi(3), 1e-6), "{unit}");
        assert!(
            !object.warnings.iter().any(|it| it.contains("inside out")),
            "{:?}",
            object.warnings
        );
        let ends = [[-3.0, 0.0, -3.0], [1.0, 7.0, 6.0]];
        for (found, end) in object.bounds.iter().flatten().zip(ends.as_flattened()) {
            assert!((found - end * length).abs() < 1e-6 * length, "{:?}", object.bounds);
        }
        assert!(read("a.3mf", &file, Some("pair")).is_ok() && read("a.3mf", &file, None).is_ok());
        let told = read("a.3mf", &file, Some("brass")).unwrap_err().to_string();
        assert!(told.contains("it has \"pair\", \"leaf\", \"resin\""), "{told}");
    }
}

#[test]
fn a_broken_3mf_tells_what_and_where() {
    let leaf = tetrahedron("id=\"1\"");
    let item = "<item objectid=\"1\"/>";
    let self_made =
        "<object id=\"1\"><components><component objectid=\"1\"/></components></object>";
    let cases: [(Vec<u8>, &[&str]); 11] = [
        (b"PK nothing".to_vec(), &["not a 3MF file"]),
        (archive("<model><resources/>"), &["nothing to build"]),
        (model("unit=\"mile\"", &leaf, item), &["unit is \"mile\"", "micron", "line 2"]),
        (
            model("", &tetrahedron("id=\"1\" pid=\"4\""), item),
            &["list 4", "has the lists: none", "line 2"],
        ),
        (model("", "", item), &["no object has the id 1"]),
        (model("", self_made, item), &["component of itself"]),
        (model("", &leaf.replace("v3=\"2\"", "v3=\"4\""), item), &["4 is not a vertex", "line 4"]),
        (model("", &leaf.replace("x=\"1\"", "x=\"one\""), item), &["x is \"one\"", "line 2"]),
        (model("", &leaf.replace("y=\"1\"", ""), item), &["attribute y is missing", "line 3"]),
        (model("", &leaf, "<item objectid=\"1\" transform=\"1 2\"/>"), &["transform is \"1 2\""]),
        (model("", &leaf, "<item objectid=\"1\"></thing>"), &["not valid XML"]),
    ];
    for (bytes, words) in cases {
        let told = refused("a.3mf", &bytes);
        assert!(words.iter().all(|word| told.contains(word)), "{words:?}: {told}");
    }
    let two = "<basematerials id=\"4\"><base name=\"tin\"/></basematerials>";
    let beyond =
        model("", &(two.to_owned() + &tetrahedron("id=\"1\" pid=\"4\" pindex=\"1\"")), item);
    assert!(refused("a.3mf", &beyond).contains("material 1 of the list 4 is used; the list has 1"));
}

#[test]
fn a_3mf_that_grows_without_end_is_refused() {
    // Forty levels, each twice the one before: 2^40 tetrahedra, and as many of nothing.
    for leaf in [tetrahedron("id=\"0\""), "<object id=\"0\"><mesh/></object>".to_owned()] {
        let double = |id: u32| {
            let component = format!("<component objectid=\"{}\"/>", id - 1);
            format!("<object id=\"{id}\"><components>{component}{component}</components></object>")
        };
        let objects = leaf + &(1..=40).map(double).collect::<String>();
        let told = refused("a.3mf", &model("", &objects, "<item objectid=\"40\"/>"));
        assert!(told.contains("32 bits") || told.contains("no triangles"), "{told}");
    }
    let deep = |id: u32| {
        format!(
            "<object id=\"{id}\"><components><component objectid=\"{}\"/></components></object>",
            id - 1
        )
    };
    let objects = tetrahedron("id=\"0\"") + &(1..200).map(deep).collect::<String>();
    let told = refused("a.3mf", &model("", &objects, "<item objectid=\"199\"/>"));
    assert!(told.contains("more than 64 deep"), "{told}");
}
