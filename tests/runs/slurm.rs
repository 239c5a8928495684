//! Scripts for Slurm: their options, their words as a shell takes them, and refusals of what no script can
//! hold. `tests/slurm.sh` runs them by a real Slurm.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use super::shards::{SCENE, refused};
use crate::support::program::{Workplace, ended};
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::process::Command;

const PLAN: [&str; 6] = ["plan", "scene.toml", "--no-device", "--shards", "3", "--slurm"];

fn planned(place: &Workplace, more: &[&str]) {
    ended(&place.beamlet(&[&PLAN[..], more].concat()), 0);
}

/// A script, which has to be one of bash.
#[track_caller]
fn script(run: &Path, name: &str) -> String {
    let path = run.join("slurm").join(name);
    let checked = Command::new("bash").arg("-n").arg(&path).status().unwrap();
    assert!(checked.success(), "{name} is no shell");
    fs::read_to_string(path).unwrap()
}

/// Words that a script of `run` gives to Apptainer and sbatch, one in a line.
fn words_of(run: &Path, script: &str) -> Vec<String> {
    let shell = "words() { printf '%s\\n' \"$@\" >> \"$WORDS\"; }; apptainer() { words \"$@\"; }; \
                 sbatch() { words \"$@\"; }; . \"$1\"";
    let words = tempfile::NamedTempFile::new().unwrap();
    let mut command = Command::new("bash");
    command.args(["-c", shell, "bash"]).arg(run.join("slurm").join(script));
    command.env("WORDS", words.path()).env("SLURM_ARRAY_TASK_ID", "2");
    assert!(command.status().unwrap().success(), "{script}");
    fs::read_to_string(words.path()).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn scripts_for_slurm_have_the_options_and_are_shell() {
    let place = Workplace::new(SCENE);
    fs::write(place.path("site.sh"), "#!/bin/bash\n{options}\nmodule load vulkan\n{command}\n")
        .unwrap();
    let options = ["--at-once", "2", "--sbatch-option", "gres=gpu:1", "-o", "run"];
    let more =
        ["--sbatch-option", "exclusive=", "--template", "site.sh", "--memory-limit", "1 GiB"];
    planned(&place, &[&options[..], &more].concat());
    let run = place.path("run");
    let shards = script(&run, "shards.sbatch");
    for line in [
        "#SBATCH --array=0-2%2\n",
        "#SBATCH --requeue\n",
        "#SBATCH --signal=B:TERM@90\n",
        "#SBATCH --gres=gpu:1\n",
        "#SBATCH --exclusive\n",
        "\nmodule load vulkan\n",
        "--shard \"$SLURM_ARRAY_TASK_ID/3\"",
        "--memory-limit 1073741824B",
    ] {
        assert!(shards.contains(line), "{line:?} is not in\n{shards}");
    }
    assert!(!script(&run, "join.sbatch").contains("--array"));
    assert!(script(&run, "submit.sh").contains("--dependency=\"afterok:"));
    // Refusals.
    fs::write(place.path("bad.sh"), "#!/bin/bash\n{options}\n").unwrap();
    let bad = [&PLAN[..], &["-o", "bad", "--template", "bad.sh"]].concat();
    refused(&place, &bad, &["bad.sh", "0 lines with {command}"]);
    let set = [&PLAN[..], &["-o", "bad", "--sbatch-option", "array=0-9"]].concat();
    refused(&place, &set, &["array is set by the plan"]);
    let alone = [&PLAN[..5], &["-o", "bad", "--at-once", "2"]].concat();
    refused(&place, &alone, &["--slurm"]);
    assert!(!place.path("bad").exists());
}

/// Apptainer is given the folders of the run and of the files of the scene, and files that links lead to.
#[test]
fn a_container_has_the_folders_of_the_run_and_of_the_files_of_the_scene() {
    let material = "material = \"plastic\"\n";
    let placed = [material, "instances = \"tables/places.csv\"\n"].concat();
    let place = Workplace::new(&SCENE.replace(material, &placed));
    let here = place.path("").canonicalize().unwrap();
    for folder in ["tables", "kept"] {
        fs::create_dir(here.join(folder)).unwrap();
    }
    fs::write(here.join("kept/places.csv"), "x_mm,y_mm,z_mm\n0,0,0\n").unwrap();
    std::os::unix::fs::symlink("../kept/places.csv", here.join("tables/places.csv")).unwrap();
    let run = here.join("it's a $(run)");
    let name = run.to_str().unwrap();
    planned(&place, &["--container", "beamlet 1.sif", "-o", name]);
    let text = |path: &str| here.join(path).to_str().unwrap().to_owned();
    let folders = [name.to_owned(), text("kept"), text("tables")].join(",");
    let begin = ["exec", "--nv", "--bind", &folders, &text("beamlet 1.sif"), "beamlet"];
    script(&run, "join.sbatch");
    let join = words_of(&run, "join.sbatch");
    assert_eq!(join, [&begin[..], &["join", name]].concat());
    script(&run, "shards.sbatch");
    let scene = format!("{name}/scene.toml");
    let simulate = ["simulate", &scene, "--shard", "2/3", "-o", name];
    let shard = words_of(&run, "shards.sbatch");
    assert_eq!(shard, [&begin[..], &simulate].concat());
    script(&run, "submit.sh");
    let submitted = words_of(&run, "submit.sh");
    let scripts = format!("{name}/slurm/");
    assert_eq!(submitted[..2], ["--parsable".to_owned(), scripts.clone() + "shards.sbatch"]);
    assert_eq!(submitted.last(), Some(&(scripts + "join.sbatch")));
    // Images elsewhere keep their address.
    planned(&place, &["--container", "docker://lab/beamlet:1", "-o", "other"]);
    let text = script(&here.join("other"), "join.sbatch");
    assert!(text.contains(" docker://lab/beamlet:1 beamlet join "), "{text}");
}

#[test]
fn words_that_no_script_can_hold_are_refused_and_nothing_is_made() {
    let place = Workplace::new(SCENE);
    let refused_with = |more: &[&str], expected: &[&str]| {
        refused(&place, &[&PLAN[..], more].concat(), expected);
    };
    let control = "has a control character";
    refused_with(&["-o", "run\n#SBATCH --uid=0"], &["--output", control, "\\u000a#SBATCH"]);
    refused_with(&["-o", "run\\1"], &["--output", "run\\1", "Slurm drops"]);
    let other = ["-o", "run", "--container"];
    refused_with(&[&other[..], &["a\r.sif"]].concat(), &["--container", control]);
    refused_with(&["-o", "run:1", "--container", "a.sif"], &["--container", "run:1", "colon"]);
    let device =
        ["plan", "scene.toml", "--shards", "3", "--slurm", "-o", "run", "--device", "a\nb"];
    refused(&place, &device, &["--device", control]);
    let option = ["-o", "run", "--sbatch-option"];
    for value in ["comment=a\nb", "comment=a\\b"] {
        refused_with(&[&option[..], &[value]].concat(), &["allowed in a value"]);
    }
    let no_text = PathBuf::from(std::ffi::OsStr::from_bytes(b"run\xff"));
    let mut command = crate::support::program::beamlet(place.path(""));
    let output = command.args(PLAN).arg("-o").arg(no_text).output().unwrap();
    assert!(ended(&output, 2).contains("is no Unicode text"));
    let made: Vec<_> = fs::read_dir(place.path("")).unwrap().collect();
    assert_eq!(made.len(), 1, "{made:?}");
}
