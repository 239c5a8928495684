//! Scripts for Slurm: an array of shards, the join behind it, and what submits both.

use super::simulate::quoted;
use crate::args::PlanArguments;
use crate::failure::Failure;
use beamlet::cli_support::{printed, write_file};
use beamlet::scene::Scene;
use beamlet::stack::{canonical, layout};
use std::collections::BTreeSet;
use std::ffi::OsStr;
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

/// Scripts of a planned run, not written yet.
pub(super) struct Scripts {
    folder: PathBuf,
    texts: [(&'static str, String); 3],
}

impl Scripts {
    /// The scripts of a run; `None` where none are wanted.
    pub(super) fn of(arguments: &PlanArguments, scene: &Scene) -> Result<Option<Self>, Failure> {
        if !arguments.slurm.slurm {
            return Ok(None);
        }
        let template = template(arguments.slurm.template.as_deref())?;
        let run = std::path::absolute(&arguments.output).map_err(|error| Failure::File {
            path: arguments.output.clone(),
            problem: error.to_string(),
        })?;
        let run = match arguments.slurm.container {
            Some(_) => canonical(&run),
            None => run,
        };
        let program = program(arguments, scene, &run)?;
        let folder = run.join(layout::SCRIPTS);
        let text = Script {
            arguments,
            run: plain("--output", &run)?,
            folder: of_option("--output", &folder)?,
            program,
        };
        let texts = [
            (SHARDS, filled(&template, &text.options(true), &text.shards()?)),
            (JOIN, filled(&template, &text.options(false), &text.join())),
            (SUBMIT, text.submit()),
        ];
        Ok(Some(Self { folder, texts }))
    }

    /// Writes them into the folder of the run.
    pub(super) fn write(&self) -> Result<(), Failure> {
        for (name, text) in &self.texts {
            write_file(&self.folder.join(name), text.as_bytes())?;
        }
        Ok(())
    }
}

/// The text of the scripts around options and command.
fn template(path: Option<&Path>) -> Result<String, Failure> {
    let Some(path) = path else { return Ok(TEMPLATE.to_owned()) };
    let failed = |problem: String| Failure::File { path: path.to_owned(), problem };
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
    Ok(text)
}

/// The text of a word of a script: a line break would end its line, and another text is another path.
fn plain(key: &str, word: &(impl AsRef<OsStr> + ?Sized)) -> Result<String, Failure> {
    let word = word.as_ref();
    let refused = |problem: &str| {
        let word = printed::path(Path::new(word));
        Failure::Usage(format!(
            "{key}: {word} {problem}; allowed in a script for Slurm: Unicode text without control \
             characters"
        ))
    };
    match word.to_str() {
        None => Err(refused("is no Unicode text")),
        Some(text) if text.contains(char::is_control) => Err(refused("has a control character")),
        Some(text) => Ok(text.to_owned()),
    }
}

/// As [`plain`] for a path in a line of options, where Slurm drops each `\`.
fn of_option(key: &str, path: &Path) -> Result<String, Failure> {
    let text = plain(key, path)?;
    if text.contains('\\') {
        let problem = format!("{key}: {text} has a \\, which Slurm drops from paths of logs");
        return Err(Failure::Usage(problem));
    }
    Ok(text)
}

/// Command of beamlet: this program, or the program of a container.
fn program(arguments: &PlanArguments, scene: &Scene, run: &Path) -> Result<String, Failure> {
    if let Some(image) = &arguments.slurm.container {
        let mut binds = Vec::new();
        for folder in bound(scene, run) {
            let folder = plain("--container", &folder)?;
            if folder.contains([',', ':']) {
                let problem = "which separate the paths of --bind of Apptainer";
                return Err(Failure::Usage(format!(
                    "--container: the folder {folder} has a comma or colon, {problem}"
                )));
            }
            binds.push(folder);
        }
        // A job begins in the folder that it is submitted from.
        let image = match image.contains("://") {
            true => PathBuf::from(image),
            false => std::path::absolute(image).unwrap_or_else(|_| image.into()),
        };
        let image = quoted(&plain("--container", &image)?);
        return Ok(format!(
            "apptainer exec --nv --bind {} {image} beamlet",
            quoted(&binds.join(","))
        ));
    }
    // Elsewhere, as in the Python package, the program of this process is another one.
    let own =
        std::env::current_exe().ok().filter(|path| path.file_stem() == Some("beamlet".as_ref()));
    match own {
        Some(path) => Ok(quoted(&plain("the path of beamlet", &path)?)),
        None => Ok("beamlet".to_owned()),
    }
}

/// Folders that a container needs: the run, and the files of the scene with the files that links there lead
/// to.
fn bound(scene: &Scene, run: &Path) -> BTreeSet<PathBuf> {
    let files = scene.input_files();
    let paths = files.iter().filter_map(|file| std::path::absolute(file).ok());
    let paths = paths.flat_map(|path| [canonical(&path), path]);
    let folders = paths.filter_map(|path| path.parent().map(Path::to_path_buf));
    folders.chain([run.to_path_buf()]).collect()
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
    run: String,
    folder: String,
    /// Words of a shell.
    program: String,
}

impl Script<'_> {
    /// Lines for sbatch.
    fn options(&self, is_array: bool) -> String {
        let slurm = &self.arguments.slurm;
        let name = Path::new(&self.run).file_name().unwrap_or_default().to_string_lossy();
        // % begins a replacement of Slurm.
        let folder = self.folder.replace('%', "%%");
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
    fn shards(&self) -> Result<String, Failure> {
        let engine = &self.arguments.engine;
        let mut more = String::new();
        if let Some(device) = &engine.device.device {
            more.push_str(&format!(" --device {}", quoted(&plain("--device", device)?)));
        }
        if let Some(limit) = engine.memory_limit {
            more.push_str(&format!(" --memory-limit {limit}B"));
        }
        let run = quoted(&self.run);
        let scene = quoted(&format!("{}/{}", self.run, layout::SCENE));
        Ok(format!(
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
            program = self.program,
            shards = self.arguments.shards,
        ))
    }

    fn join(&self) -> String {
        format!("{} join {}", self.program, quoted(&self.run))
    }

    fn submit(&self) -> String {
        let script = |name: &str| quoted(&format!("{}/{name}", self.folder));
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
}
