//! What is on disk stays: the program replaces nothing that it reads, nothing through a link,
//! nothing of others, nothing while another writes it, and nothing on a full disk.
#![cfg(all(feature = "cli", unix))]
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::symlink;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

const SCENE: &str = concat!(
    include_str!("support/masks.toml"),
    r#"
[detector]
distance = "1.8 m"
pixels = [8, 2]
pitch = "150 um"

[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 4 }
angles = { from = "0 deg", to = "180 deg", count = 3 }

[[object]]
name = "rod"
shape = { cylinder = { radius = "0.2 mm", height = "16 mm", sides = 16 } }
material = "plastic"

[materials.plastic]
mu = "0.25 /cm"
delta = 2.4e-7
"#
);

fn workplace() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("scene.toml"), SCENE).unwrap();
    directory
}

fn beamlet(place: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
    command.current_dir(place).env_remove("RUST_LOG").args(line.split_whitespace());
    command
}

/// Runs the words of `line`, which must end with this code; stderr.
#[track_caller]
fn ends(place: &Path, line: &str, code: i32) -> String {
    assert_code(beamlet(place, line).output().unwrap(), code, line)
}

#[track_caller]
fn assert_code(output: Output, code: i32, line: &str) -> String {
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{line}: {message}");
    message
}

#[track_caller]
fn simulate(place: &Path, more: &str) {
    ends(place, &format!("simulate scene.toml -q --backend bvh -o run {more}"), 0);
}

/// Every file below a folder with its bytes, links not followed.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let kind = fs::symlink_metadata(&path).unwrap();
        if kind.is_symlink() {
            all.insert(
                path.clone(),
                fs::read_link(&path).unwrap().into_os_string().into_encoded_bytes(),
            );
        } else if kind.is_dir() {
            all.extend(contents(&path));
        } else {
            all.insert(path.clone(), fs::read(&path).unwrap());
        }
    }
    all
}

#[test]
fn illuminate_never_replaces_the_run_or_the_scene_that_it_reads() {
    let place = workplace();
    simulate(place.path(), "--keep-moments");
    symlink("run", place.path().join("link")).unwrap();
    for name in ["run.toml", "other.toml"] {
        fs::copy(place.path().join("scene.toml"), place.path().join(name)).unwrap();
    }
    let before = contents(place.path());
    let one = "--scene scene.toml --overwrite -o";
    for line in [
        &format!("run {one} run"),
        &format!("run {one} run/."),
        &format!("run {one} link"),
        &format!("link {one} run"),
        &format!("run {one} none/../run"),
        &format!("run {one} run/moments"),
        "run --scene other.toml --scene run.toml --overwrite -o .",
    ] {
        let message = ends(place.path(), &format!("illuminate {line}"), 1);
        assert!(message.contains("which this command reads"), "{line}: {message}");
        assert_eq!(contents(place.path()), before, "{line}");
    }
    let message = ends(place.path(), "simulate run/scene.toml -o run --overwrite", 1);
    assert!(message.contains("which this command reads"), "{message}");
    assert_eq!(contents(place.path()), before);
    // Two names of one directory are one directory.
    ends(place.path(), "illuminate run --scene scene.toml --scene other.toml -o out", 0);
    fs::remove_dir_all(place.path().join("out/other")).unwrap();
    symlink("scene", place.path().join("out/other")).unwrap();
    let line = "illuminate run --scene scene.toml --scene other.toml -o out --overwrite";
    assert!(ends(place.path(), line, 2).contains("two scenes"));
    // Beside the run's own files there is room.
    ends(place.path(), "illuminate run --scene scene.toml -o run/again", 0);
}

#[test]
fn pictures_pages_and_images_never_replace_what_they_are_made_of() {
    let place = workplace();
    simulate(place.path(), "");
    let at = |name: &str| place.path().join(name);
    ends(place.path(), "example cylinders -o given", 0);
    ends(place.path(), "spectrum --anode W --kvp 60kV --plot tube.svg", 0);
    fs::write(at("table.svg"), "10,1\n20,3\n30,1\n").unwrap();
    fs::create_dir(at("d.partial")).unwrap();
    fs::create_dir(at("images")).unwrap();
    for step in 0..4 {
        let name = format!("step_{step:03}.exr");
        fs::copy(at("run/flat").join(&name), at("d.partial").join(&name)).unwrap();
    }
    let before = contents(place.path());
    for (line, code) in [
        ("report run -o run/run.json --overwrite", 1),
        ("report run -o run/./progress.log --overwrite", 1),
        ("view run -o run/flat --overwrite", 1),
        ("spectrum table.svg --plot ./table.svg --overwrite", 1),
        ("retrieve run -o run --overwrite", 1),
        ("retrieve run -o run/sample/images", 1),
        ("compare d.partial run/flat --difference d", 2),
        ("compare run/flat run/flat --difference run/flat/d", 2),
    ] {
        ends(place.path(), line, code);
        assert_eq!(contents(place.path()), before, "{line}");
    }
    ends(place.path(), "compare run/flat run/flat --difference images", 0);
    assert!(at("images/stack").is_dir() && !at("images.partial").exists());
    assert_eq!(contents(&at("images")).len(), 4);
}

#[test]
fn retrieved_images_are_replaced_without_the_files_of_others() {
    let place = workplace();
    simulate(place.path(), "");
    let at = |name: &str| place.path().join(name);
    ends(place.path(), "retrieve run -o images -q", 0);
    // In a folder of images, and under the names that are needed beside them.
    for file in ["images/refraction/notes.txt", "images.replaced/thesis.tex"] {
        fs::create_dir_all(at(file).parent().unwrap()).unwrap();
        fs::write(at(file), "mine").unwrap();
        let before = contents(place.path());
        let name = Path::new(file).file_name().unwrap().to_str().unwrap();
        let message = ends(place.path(), "retrieve run -o images -q --overwrite", 1);
        assert!(message.contains(name) || message.contains("images.replaced"), "{message}");
        assert_eq!(contents(place.path()), before, "{file}");
        fs::remove_file(at(file)).unwrap();
    }
    fs::remove_dir(at("images.replaced")).unwrap();
    // A link to a scratch disk stays one.
    fs::create_dir(at("scratch")).unwrap();
    fs::rename(at("images"), at("scratch/images")).unwrap();
    symlink("scratch/images", at("images")).unwrap();
    ends(place.path(), "retrieve run -o images -q --overwrite --format npy", 0);
    assert!(at("images").is_symlink());
    assert!(at("scratch/images/refraction.npy").exists());
    assert_eq!(fs::read_dir(at("scratch")).unwrap().count(), 1);
}

#[test]
fn of_two_that_overwrite_one_run_at_once_only_one_does() {
    let place = workplace();
    simulate(place.path(), "--keep-moments");
    // Others may keep files there; and who removes them takes long to clear the run.
    for view in 100..20_100 {
        fs::write(place.path().join(format!("run/moments/view_{view:05}.bin")), "").unwrap();
    }
    let line = "simulate scene.toml -q --backend bvh -o run --overwrite";
    let children: Vec<_> = (0..2)
        .map(|_| {
            let mut command = beamlet(place.path(), line);
            command.stdout(Stdio::null()).stderr(Stdio::piped());
            command.spawn().unwrap()
        })
        .collect();
    let outputs: Vec<Output> =
        children.into_iter().map(|child| child.wait_with_output().unwrap()).collect();
    let done = outputs.iter().filter(|output| output.status.success()).count();
    let messages: Vec<_> = outputs.iter().map(|o| String::from_utf8_lossy(&o.stderr)).collect();
    assert_eq!(done, 1, "{messages:?}");
    assert!(messages.concat().contains("another beamlet is using this run"), "{messages:?}");
    assert_eq!(fs::read_dir(place.path().join("run/moments")).unwrap().count(), 20_000);
    ends(place.path(), "simulate scene.toml -q -o run --resume", 0);
    ends(place.path(), "report run", 0);
}

#[test]
fn links_inside_a_run_are_named_and_not_followed() {
    for (format, names) in [
        (
            "exr",
            [
                "progress.log",
                "run.json",
                "flat",
                "sample",
                "sample/view_0001",
                "sample/view_0001/step_002.exr",
                "moments",
                "moments/view_0001.bin",
                "scene.toml.new",
                "run.json.new",
                "partial",
            ]
            .as_slice(),
        ),
        ("npy", &["flat.npy", "sample.npy"]),
    ] {
        let place = workplace();
        simulate(place.path(), &format!("--keep-moments --format {format}"));
        let at = |name: &str| place.path().join(name);
        for name in names {
            let path = at("run").join(name);
            if !path.exists() {
                fs::write(&path, "precious").unwrap();
            }
            fs::rename(&path, at("elsewhere")).unwrap();
            symlink(at("elsewhere"), &path).unwrap();
            let before = contents(place.path());
            for how in ["--overwrite", "--resume", "--overwrite --keep-moments"] {
                let line = format!("simulate scene.toml -q --backend bvh -o run {how}");
                let message = ends(place.path(), &line, 1);
                let named = message.contains(&format!("run/{name}: is a link"));
                assert!(named, "{how}: {name}: {message}");
                assert_eq!(contents(place.path()), before, "{how}: {name}");
            }
            fs::remove_file(&path).unwrap();
            fs::rename(at("elsewhere"), &path).unwrap();
            if name.ends_with(".new") || *name == "partial" {
                fs::remove_file(&path).unwrap();
            }
        }
        ends(place.path(), "simulate scene.toml -q -o run --resume", 0);
    }
}

#[test]
fn a_run_may_itself_be_a_link_and_files_of_others_in_it_stay() {
    let place = workplace();
    let at = |name: &str| place.path().join(name);
    fs::create_dir(at("scratch")).unwrap();
    symlink("scratch", at("run")).unwrap();
    simulate(place.path(), "--keep-moments");
    let others = [
        "run/moments/view_of_the_lab.bin",
        "run/moments/view_0007.bin",
        "run/moments/view_00001.bin",
        "run/sample/view_0001/notes.txt",
        "run/sample/view_0009/step_000.exr",
        "run/flat/step_0001.exr",
        "run/scene.txt",
    ];
    for other in others {
        fs::create_dir_all(at(other).parent().unwrap()).unwrap();
        fs::write(at(other), "mine").unwrap();
    }
    simulate(place.path(), "--overwrite");
    for other in others {
        assert_eq!(fs::read_to_string(at(other)).unwrap(), "mine", "{other}");
    }
    assert!(at("run").is_symlink() && at("scratch/run.json").exists());
    assert!(!at("run/moments/view_0001.bin").exists());
    // What bears a name of ours and is not ours: left, or named where it would be replaced.
    fs::write(at("run/moments/view_0001.bin"), "also mine").unwrap();
    simulate(place.path(), "--overwrite");
    let line = "simulate scene.toml -q --backend bvh -o run --overwrite --keep-moments";
    assert!(ends(place.path(), line, 1).contains("view_0001.bin: was not written by beamlet"));
    assert_eq!(fs::read_to_string(at("run/moments/view_0001.bin")).unwrap(), "also mine");
}

/// Runs as on a disk that is full once a file has so many KiB: further writes fail.
fn with_full_disk(place: &Path, kib: u64, line: &str) -> Output {
    let program = env!("CARGO_BIN_EXE_beamlet");
    // Without the trap the system ends the program instead of letting the write fail.
    let script = format!("trap '' XFSZ; ulimit -f {kib}; exec '{program}' {line}");
    Command::new("bash").args(["-c", &script]).current_dir(place).output().unwrap()
}

/// Bytes of the largest file at or below a path.
fn largest(path: &Path) -> u64 {
    match path.is_dir() {
        true => contents(path).values().map(|bytes| bytes.len() as u64).max().unwrap(),
        false => fs::metadata(path).unwrap().len(),
    }
}

#[test]
fn a_full_disk_is_an_error_of_every_writer_up_to_the_last_byte() {
    let place = workplace();
    let at = |name: &str| place.path().join(name);
    simulate(place.path(), "");
    let pixels: Vec<u8> = (0..24_576_u32).map(|i| u8::try_from(i * 7919 % 251).unwrap()).collect();
    let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (1, 128, 192), }";
    let mut npy = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    npy.extend(format!("{header:<117}\n").bytes());
    npy.extend(&pixels);
    fs::write(at("a.npy"), &npy).unwrap();
    npy.splice(128.., pixels.iter().rev().copied());
    fs::write(at("b.npy"), &npy).unwrap();
    let compare = "compare a.npy b.npy --tolerance 1e9 --difference out --format";
    for (line, code) in [
        (&*format!("{compare} tiff"), 2),
        (&format!("{compare} npy"), 2),
        (&format!("{compare} exr"), 2),
        ("spectrum --anode W --kvp 60kV --plot out.svg --overwrite", 1),
        ("spectrum --anode W --kvp 60kV --plot out.png --overwrite", 1),
        ("report run -o out.html --overwrite", 1),
        ("example cylinder -o out --overwrite", 1),
    ] {
        let out = ["out", "out.svg", "out.png", "out.html"];
        let out = out
            .map(at)
            .into_iter()
            .find(|path| {
                line.contains(path.file_name().unwrap().to_str().unwrap())
                    && (path.extension().is_some() || !line.contains("out."))
            })
            .unwrap();
        ends(place.path(), line, 0);
        let whole = contents(place.path());
        let kib = largest(&out).div_ceil(1024);
        // Images of differences are not replaced.
        if line.starts_with("compare") {
            fs::remove_dir_all(&out).unwrap();
        }
        let before = contents(place.path());
        // Around the buffers' ends, and the last write in any case.
        for room in (0..kib).rev().step_by(usize::try_from(kib / 12 + 1).unwrap()).chain([kib - 1])
        {
            let output = with_full_disk(place.path(), room, line);
            let message = assert_code(output, code, line);
            assert!(message.contains("cannot be written"), "{line}: {message}");
            assert_eq!(contents(place.path()), before, "{line} with {room} KiB");
        }
        assert_code(with_full_disk(place.path(), kib, line), 0, line);
        assert_eq!(contents(place.path()).len(), whole.len());
        if out.is_dir() {
            fs::remove_dir_all(&out).unwrap();
        }
    }
}

#[test]
fn devices_are_written_to_and_not_replaced() {
    let place = workplace();
    simulate(place.path(), "");
    symlink("/dev/full", place.path().join("page.html")).unwrap();
    let message = ends(place.path(), "report run -o page.html --overwrite", 1);
    assert!(message.contains("page.html: cannot be written"), "{message}");
    let output = beamlet(place.path(), "report run -o /dev/stdout --overwrite").output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stdout.starts_with(b"<!"), "the page itself");
    assert!(place.path().join("page.html").is_symlink());
    assert!(Path::new("/dev/full").exists());
}

#[test]
fn results_that_stdout_does_not_take_are_an_error() {
    let place = workplace();
    simulate(place.path(), "");
    for line in [
        "check scene.toml --json",
        "compare run run --json",
        "devices --json",
        "example",
        "material --json",
        "material gold --energy 30keV",
        "spectrum --anode W --kvp 60kV --json",
        "retrieve run --json -q",
        "report run",
        "view run -o pictures",
        "simulate scene.toml -q -o run --resume",
    ] {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let output = beamlet(place.path(), line).stdout(full).output().unwrap();
        let message = assert_code(output, 1, line);
        assert!(message.contains("stdout cannot be written"), "{line}: {message}");
    }
}

#[test]
fn a_run_that_claims_more_than_a_scene_may_ask_for_is_refused_at_once() {
    let place = workplace();
    simulate(place.path(), "--keep-moments");
    let path = place.path().join("run/run.json");
    let text = fs::read_to_string(&path).unwrap();
    for (claim, problem) in [
        ("\"views\": 4000000000", "4000000000 views; allowed: 1 to 10000000"),
        ("\"views\": 0", "0 views; allowed: 1"),
        ("\"views\": 9999999", "claims Extent"),
    ] {
        fs::write(&path, text.replace("\"views\": 3", claim)).unwrap();
        let before = contents(place.path());
        for (line, code) in [
            ("retrieve run -q", 1),
            ("report run", 1),
            ("view run -o pictures", 1),
            ("compare run run", 2),
            ("simulate scene.toml -q -o run --overwrite", 1),
        ] {
            let overwrites = line.ends_with("--overwrite");
            // A run that may be is replaced, whatever it claims.
            if overwrites && problem.starts_with("claims") {
                continue;
            }
            let began = Instant::now();
            let message = ends(place.path(), line, code);
            assert!(message.contains("run/run.json: "), "{line}: {message}");
            assert!(overwrites || message.contains(problem), "{line}: {message}");
            assert!(began.elapsed() < Duration::from_secs(10), "{line}: {:?}", began.elapsed());
            assert_eq!(contents(place.path()), before, "{line}");
        }
    }
    ends(place.path(), "simulate scene.toml -q -o run --overwrite", 0);
    assert!(!place.path().join("run/moments").exists());
}

#[test]
fn a_termination_signal_ends_the_program_whatever_hangs() {
    let place = workplace();
    // The loader of drivers waits for a manifest that never comes.
    let pipe = place.path().join("driver.json");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut command = beamlet(place.path(), "simulate scene.toml -o run");
    command.env("VK_DRIVER_FILES", &pipe).env("VK_ICD_FILENAMES", &pipe);
    let mut child = command.stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(500));
    assert!(child.try_wait().unwrap().is_none(), "it does not hang");
    let kill = format!("kill -TERM {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    let began = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if began.elapsed() > Duration::from_secs(30) {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("still there after 30 s");
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    // Where libraries hang as the process exits it is aborted.
    let ended = status.code() == Some(130) || status.signal() == Some(6);
    assert!(ended, "{status:?}");
}

#[test]
fn options_out_of_range_or_without_effect_are_usage_errors_with_what_is_allowed() {
    let place = workplace();
    simulate(place.path(), "");
    ends(place.path(), "retrieve run -q", 0);
    for (line, wanted) in [
        ("compare run run --tolerance nan", "from 0 on"),
        ("compare run run --tolerance -1", "from 0 on"),
        ("compare run run --tolerance inf", "from 0 on"),
        ("compare run run --format npy", "--difference"),
        ("retrieve run --gain -1", "above 0"),
        ("retrieve run --gain nan", "above 0"),
        ("retrieve run --gain 0", "above 0"),
        ("retrieve run --read-noise -3", "from 0 on"),
        ("retrieve run --read-noise nan", "from 0 on"),
        ("retrieve run --saturation nan", "above 0"),
        ("retrieve run --saturation 1e39", "3.4e38"),
        ("retrieve run --saturation -5", "above 0"),
        ("retrieve run --steps 1,x,2 --method two-step", "two steps"),
        ("retrieve run --steps 2,2 --method two-step", "two steps"),
        ("retrieve run --steps 0,2 --method gaussian", "two-step"),
        ("retrieve run --sample-offsets 1um,2um", "two-step"),
        ("view run -o p --show frames --pixel 1,1", "--show profiles, curve, sinograms"),
        ("view run -o p --show retrieved --step 1", "--show frames"),
        ("view run -o p --show frames --row 1", "--show profiles"),
        ("material H999999999999 --density 1g/cm3 --energy 30keV", "1e6"),
        ("material H1e300O --density 1g/cm3 --energy 30keV", "1e6"),
        ("material water --density 1e300g/cm3 --energy 30keV", "100 g/cm3"),
    ] {
        let message = ends(place.path(), line, 2);
        assert!(message.contains(wanted), "{line}: {message}");
    }
    assert!(!place.path().join("p").exists());
    for set in ["materials.x.formula=H999999999999", "materials.x.density=1e5 g/cm3"] {
        let mut command = beamlet(place.path(), "check scene.toml --set materials.x.formula=C");
        command.args(["--set", "materials.x.density=1 g/cm3", "--set", set]);
        let message = assert_code(command.output().unwrap(), 1, set);
        assert!(message.contains("allowed: ") && message.contains("materials.x."), "{message}");
    }
}

#[test]
fn names_are_printed_without_characters_that_terminals_obey() {
    let place = workplace();
    let sly = "a\u{1b}[2J\u{202e}b\u{9b}";
    let unsafe_ones = |text: &str| text.chars().any(|c| "\u{1b}\u{202e}\u{9b}\r".contains(c));
    let say = |words: &[&str]| {
        let output = beamlet(place.path(), "").args(words).output().unwrap();
        [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
    };
    simulate(place.path(), "");
    fs::copy(place.path().join("scene.toml"), place.path().join(format!("{sly}.toml"))).unwrap();
    let file = format!("{sly}.toml");
    let lines = format!("one\ntwo{sly}");
    for words in [
        ["check", "scene.toml", "--set", &format!("object[0].name='{sly}'")].as_slice(),
        &["check", "scene.toml", "--set", &format!("object[0].material='{sly}'")],
        &["check", "scene.toml", "--set", &format!("{sly}=1")],
        &["check", &lines],
        &["check", sly],
        &["simulate", &file, "-o", sly],
        &["retrieve", sly],
        &["retrieve", "run", "-o", &lines],
        &["view", "run", "-o", &format!("pictures{sly}")],
        &["material", sly],
        &["spectrum", "--anode", "W", "--kvp", "60kV", "--filter", &format!("{sly}:1mm")],
        &["example", sly, "-o", "x"],
        &["compare", "run", sly],
        &["devices", sly],
    ] {
        let [out, err] = say(words);
        assert!(!unsafe_ones(&out) && !unsafe_ones(&err), "{words:?}: {out:?} {err:?}");
        assert!(!(out + &err).contains("one\ntwo"), "{words:?}");
    }
    // A name of an object cannot make lines of its own in a report.
    let [_, err] = say(&["check", "scene.toml", "--set", "object[0].name=\"rod\\nfine\""]);
    assert!(err.contains("object[0].name") && err.contains("control"), "{err}");
}
