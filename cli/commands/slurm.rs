//! Scripts for Slurm: an array of shards, the join behind it, and what submits both.

use super::simulate::quoted;
use crate::args::{PlanArguments, SlurmArguments};
use crate::failure::Failure;
use beamlet::cli_support::write_file;
use beamlet::scene::Scene;
use beamlet::stack::layout;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Script that submits the other two.
pub(super) const SUBMIT: &str = "submit.sh";
const SHARDS: &str = "shards.sbatch";
const JOIN: &str = "join.sbatch";

/// Places in a template.
const OPTIONS: &str = "{options}";
const COMMAND: &str = "{command}";
const TEMPLATE: &str = "#!/bin/bash\n{options}\nset -eu\n{command}\n";

/// Seconds before the time limit at which Slurm sends the signal.
const NOTICE: u32 = 90;

/// The text of the scripts; `None` where none are wanted.
pub(super) fn template(arguments: &SlurmArguments) -> Result<Option<String>, Failure> {
    if !arguments.slurm {
        return Ok(None);
    }
    let Some(path) = &arguments.template else { return Ok(Some(TEMPLATE.to_owned())) };
    let failed = |problem: String| Failure::File { path: path.clone(), problem };
    let text = std::fs::read_to_string(path)
        .map_err(|error| failed(format!("cannot be read: {error}")))?;
    if !text.starts_with("#!") {
        return Err(failed("must begin with #! and an interpreter, such as #!/bin/bash".into()));
    }
    for place in [OPTIONS, COMMAND] {
        match text.lines().filter(|line| line.trim() == place).count() {
            1 => {}
            count => {
                let problem = format!(
                    "has {count} lines with {place}; allowed: one line with {OPTIONS} and one with \
                     {COMMAND}"
                );
                return Err(failed(problem));
            }
        }
    }
    Ok(Some(text))
}

/// Writes the scripts of a planned run.
pub(super) fn write(
    arguments: &PlanArguments,
    scene: &Scene,
    template: &str,
) -> Result<(), Failure> {
    let run = std::path::absolute(&arguments.output).map_err(|error| Failure::File {
        path: arguments.output.clone(),
        problem: error.to_string(),
    })?;
    let folder = run.join(layout::SCRIPTS);
    let text = Script { arguments, run: &run, folder: &folder, scene };
    let scripts = [
        (SHARDS, filled(template, &text.options(true), &text.shards())),
        (JOIN, filled(template, &text.options(false), &text.join())),
        (SUBMIT, text.submit()),
    ];
    for (name, script) in scripts {
        write_file(&folder.join(name), script.as_bytes())?;
    }
    Ok(())
}

fn filled(template: &str, options: &str, command: &str) -> String {
    let line = |line: &str| match line.trim() {
        OPTIONS => options.to_owned(),
        COMMAND => command.to_owned(),
        _ => line.to_owned(),
    };
    template.lines().map(line).map(|line| line.trim_end().to_owned() + "\n").collect()
}

/// Parts of the scripts.
struct Script<'a> {
    arguments: &'a PlanArguments,
    run: &'a Path,
    folder: &'a Path,
    scene: &'a Scene,
}

impl Script<'_> {
    /// Lines for sbatch.
    fn options(&self, is_array: bool) -> String {
        let slurm = &self.arguments.slurm;
        let name = self.run.file_name().unwrap_or_default().to_string_lossy();
        // % begins a replacement of Slurm.
        let folder = self.folder.display().to_string().replace('%', "%%");
        let log = |name: &str| format!("{folder}/{name}");
        let mut lines = Vec::new();
        let mut add = |key: &str, value: &str| {
            lines.push(match value {
                "" => format!("#SBATCH --{key}"),
                value => format!("#SBATCH --{key}={}", quoted(value)),
            });
        };
        if is_array {
            let most = slurm.at_once.map(|most| format!("%{most}")).unwrap_or_default();
            add("job-name", &format!("beamlet-{name}"));
            add("array", &format!("0-{}{most}", self.arguments.shards - 1));
            add("signal", &format!("B:TERM@{NOTICE}"));
            add("output", &log("shard-%a.log"));
        } else {
            add("job-name", &format!("beamlet-join-{name}"));
            add("output", &log("join.log"));
        }
        add("requeue", "");
        add("open-mode", "append");
        slurm.sbatch_option.iter().for_each(|[key, value]| add(key, value));
        lines.join("\n")
    }

    /// A shard: at the signal before the time limit it ends, and goes back into the queue.
    fn shards(&self) -> String {
        let engine = &self.arguments.engine;
        let mut more = String::new();
        if let Some(device) = &engine.device.device {
            more.push_str(&format!(" --device {}", quoted(device)));
        }
        if let Some(limit) = engine.memory_limit {
            more.push_str(&format!(" --memory-limit {limit}B"));
        }
        let run = self.word();
        let scene = quoted(&self.run.join(layout::SCENE).to_string_lossy());
        format!(
            "# {NOTICE} s before the time limit the shard ends, and its task goes back into the queue.\n\
             again() {{\n    \
                 kill -TERM \"$shard\" 2>/dev/null || true\n    \
                 wait \"$shard\" || true\n    \
                 scontrol requeue \"${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}\"\n    \
                 exit 0\n\
             }}\n\
             {program} simulate {scene} --shard \"$SLURM_ARRAY_TASK_ID/{shards}\" -o {run}{more} &\n\
             shard=$!\n\
             trap again TERM\n\
             wait \"$shard\"",
            program = self.program(),
            shards = self.arguments.shards,
        )
    }

    fn join(&self) -> String {
        format!("{} join {}", self.program(), self.word())
    }

    fn submit(&self) -> String {
        let script = |name: &str| quoted(&self.folder.join(name).to_string_lossy());
        format!(
            "#!/bin/sh\n\
             # Submits the shards, and the join that waits for all of them.\n\
             set -eu\n\
             shards=$(sbatch --parsable {})\n\
             sbatch --dependency=\"afterok:${{shards%%;*}}\" --kill-on-invalid-dep=yes {}\n",
            script(SHARDS),
            script(JOIN)
        )
    }

    fn word(&self) -> String {
        quoted(&self.run.to_string_lossy())
    }

    /// Command of beamlet: this program, or the program of a container.
    fn program(&self) -> String {
        if let Some(image) = &self.arguments.slurm.container {
            let binds: Vec<String> =
                self.bound().iter().map(|path| path.display().to_string()).collect();
            let binds = quoted(&binds.join(","));
            return format!("apptainer exec --nv --bind {binds} {} beamlet", quoted(image));
        }
        // Elsewhere, as in the Python package, the program of this process is another one.
        let own = std::env::current_exe()
            .ok()
            .filter(|path| path.file_stem() == Some("beamlet".as_ref()));
        own.map_or_else(|| "beamlet".to_owned(), |path| quoted(&path.to_string_lossy()))
    }

    /// Folders that a container needs: the run, and the files of the scene.
    fn bound(&self) -> BTreeSet<PathBuf> {
        let files = self.scene.input_files();
        let folders = files.iter().filter_map(|file| {
            let file = std::path::absolute(file).ok()?;
            file.parent().map(Path::to_path_buf)
        });
        folders.chain([self.run.to_path_buf()]).collect()
    }
}
