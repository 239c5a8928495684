//! What retrieved.json, the closing lines of `beamlet retrieve` and the page tell of a retrieval.

use crate::support::program::{beamlet, done};
use beamlet::retrieve::Record;
use std::fs;
use std::time::SystemTime;

const SCENE: &str = concat!(
    "title = \"Rod & <air>\"\n",
    include_str!("../support/masks.toml"),
    r#"
[detector]
distance = "1.8 m"
pixels = [16, 2]
pitch = "150 um"

[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 7 }

[[object]]
name = "rod"
shape = { cylinder = { radius = "0.4 mm", height = "9 mm" } }
material = "water"
"#
);

#[test]
fn the_order_of_measured_frames_is_shown_and_recorded() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    fs::write(folder.join("scene.toml"), SCENE).unwrap();
    done(folder, "simulate scene.toml -o run -q");
    // Names with the offsets, as a scan may have them: by letters "0um" comes before "-25um".
    let offsets = ["-25", "-16.67", "-8.33", "0", "8.33", "16.67", "25"];
    for (from, to) in [("flat", "white"), ("sample/view_0000", "rod")] {
        fs::create_dir(folder.join(to)).unwrap();
        for (step, offset) in offsets.iter().enumerate() {
            let from = folder.join("run").join(from).join(format!("step_{step:03}.exr"));
            fs::copy(from, folder.join(to).join(format!("scan_{offset}um.exr"))).unwrap();
        }
    }
    let line = "retrieve --flat white --sample rod --geometry scene.toml -o images --format npy -v";
    let output = beamlet(folder).args(line.split(' ')).output().unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{log}");
    let names = offsets.map(|offset| format!("scan_{offset}um.exr"));
    let order = format!("white: 7 frames in the order {}", names.join(", "));
    assert!(log.contains(&order), "{log}");
    let record = Record::read(&folder.join("images/retrieved.json")).unwrap();
    assert_eq!(record.frames.keys().collect::<Vec<_>>(), ["rod", "white"]);
    assert_eq!(record.frames["rod"], names);
    done(folder, "retrieve run -o same --format npy");
    let image = |of: &str| fs::read(folder.join(of).join("refraction.npy")).unwrap();
    assert!(image("images") == image("same"), "another order of frames");
}

#[test]
fn a_retrieval_tells_its_title_dates_duration_command_and_program() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    fs::write(folder.join("scene.toml"), SCENE).unwrap();
    done(folder, "simulate scene.toml -o run -q");
    let before = SystemTime::now();
    let words = ["retrieve", "run", "-o", "my images", "--format", "npy"];
    let output = beamlet(folder).args(words).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let closing = String::from_utf8(output.stdout).unwrap();
    assert!(closing.starts_with("title    Rod & <air>\nimages   "), "{closing}");

    let record = Record::read(&folder.join("my images/retrieved.json")).unwrap();
    assert_eq!(record.title.as_deref(), Some("Rod & <air>"));
    let command = "beamlet retrieve run -o 'my images' --format npy";
    assert_eq!(record.command.as_deref(), Some(command));
    assert_eq!(record.version, env!("CARGO_PKG_VERSION"));
    assert_eq!(record.commit.as_deref(), option_env!("BEAMLET_COMMIT"));
    // Whole seconds, cut off.
    let [began, written] = [&record.began, &record.written]
        .map(|date| humantime::parse_rfc3339(date.as_deref().unwrap()).unwrap());
    let second = std::time::Duration::from_secs(1);
    assert!(began + second >= before && began <= written && written <= SystemTime::now());
    let longest = written.duration_since(began).unwrap().as_secs_f64() + 1.0;
    assert!(record.duration_s > 0.0 && record.duration_s <= longest, "{record:?}");

    let report = |page: &str| {
        let words = ["report", "my images", "-o", page];
        assert!(beamlet(folder).args(words).output().unwrap().status.success());
    };
    report("page.html");
    let page = fs::read_to_string(folder.join("page.html")).unwrap();
    assert!(page.contains("beamlet retrieve run -o &#x27;my images&#x27; --format npy"), "command");
    assert!(page.contains("Rod &amp; &lt;air&gt;") && !page.contains("<air>"), "title");
}
