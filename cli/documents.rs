//! Documents against the program: docs/cli.md is made from the arguments, and every command that a
//! document or a help text shows is one that the program accepts. `BEAMLET_WRITE_DOCS=1` writes the page.

use crate::args::Arguments;
use clap::error::ErrorKind;
use clap::{Arg, Command, CommandFactory, Parser};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

const PAGE: &str = "docs/cli.md";
/// Line above the part of the page that is made.
const MARK: &str =
    "<!-- made from the arguments: BEAMLET_WRITE_DOCS=1 cargo test --release --bin beamlet -->";

/// The program with the usage lines of its verbs.
fn program() -> Command {
    let mut program = Arguments::command();
    program.build();
    program
}

fn verbs(program: &Command) -> impl Iterator<Item = &Command> {
    program.get_subcommands().filter(|verb| verb.get_name() != "help")
}

/// The part of the page below the mark.
fn reference() -> String {
    let mut program = program();
    let mut out = String::from("\n## Verbs\n\n| verb | does |\n|---|---|\n");
    for verb in verbs(&program) {
        let name = verb.get_name();
        let about = verb.get_about().map(ToString::to_string).unwrap_or_default();
        let _ = writeln!(out, "| [`{name}`](#{name}) | {about} |");
    }
    let shared = shared_rows(&program);
    out.push_str("\n## Options of several verbs\n\n| option | meaning | verbs |\n|---|---|---|\n");
    for (row, of) in &shared {
        let all = of.len() == verbs(&program).count();
        let _ = writeln!(out, "{row} {} |", if all { "all".to_owned() } else { of.join(", ") });
    }
    for verb in program.get_subcommands_mut().filter(|verb| verb.get_name() != "help") {
        out.push_str(&section(verb, &shared));
    }
    out
}

/// Rows of options that three verbs or more share, with the names of these verbs.
fn shared_rows(program: &Command) -> BTreeMap<String, Vec<String>> {
    let mut rows: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for verb in verbs(program) {
        for row in rows_of(verb).filter(|row| row.contains("`--")) {
            rows.entry(row).or_default().push(format!("`{}`", verb.get_name()));
        }
    }
    rows.retain(|_, of| of.len() >= 3);
    rows
}

/// A row of a table for each argument of a verb.
fn rows_of(verb: &Command) -> impl Iterator<Item = String> {
    let shown = |arg: &&Arg| !arg.is_hide_set() && arg.get_id() != "help";
    verb.get_arguments()
        .filter(shown)
        .map(|arg| format!("| {} | {} |", spelling(arg), meaning(arg)))
}

/// Usage, examples and the arguments of a verb but for `shared` ones.
fn section(verb: &mut Command, shared: &BTreeMap<String, Vec<String>>) -> String {
    let usage = verb.render_usage().to_string();
    let usage = usage.trim_start_matches("Usage: ").replace('\n', " ");
    let about = verb.get_about().map(ToString::to_string).unwrap_or_default();
    let mut out = format!("\n## {}\n\n{about}.\n\n```text\n{usage}\n```\n", verb.get_name());
    let (examples, text) = examples(verb);
    if !examples.is_empty() {
        let _ = write!(out, "\n```sh\n{}\n```\n", examples.join("\n"));
    }
    text.iter().for_each(|text| _ = write!(out, "\n{text}\n"));
    let own: Vec<String> = rows_of(verb).filter(|row| !shared.contains_key(row)).collect();
    if !own.is_empty() {
        let _ = write!(out, "\n| argument | meaning |\n|---|---|\n{}\n", own.join("\n"));
    }
    out
}

/// Examples and paragraphs of the text below the options.
fn examples(verb: &Command) -> (Vec<String>, Vec<String>) {
    let text = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
    let (mut examples, mut paragraphs) = (Vec::new(), Vec::new());
    for part in text.split("\n\n").filter(|part| !part.is_empty()) {
        match part.strip_prefix("Examples:\n").or_else(|| part.strip_prefix("Example:\n")) {
            Some(lines) => examples.extend(lines.lines().map(|line| line.trim().to_owned())),
            None => paragraphs.push(part.replace("\n  ", " ")),
        }
    }
    (examples, paragraphs)
}

fn spelling(arg: &Arg) -> String {
    let names: Vec<_> =
        arg.get_value_names().unwrap_or_default().iter().map(ToString::to_string).collect();
    let takes = arg.get_action().takes_values();
    let value = if takes { names.join(" ").replace('|', "\\|") } else { String::new() };
    let Some(long) = arg.get_long() else { return format!("`{value}`") };
    let short = arg.get_short().map(|short| format!("`-{short}`, ")).unwrap_or_default();
    format!("{short}`{}`", format!("--{long} {value}").trim_end())
}

fn meaning(arg: &Arg) -> String {
    let help = arg.get_long_help().or_else(|| arg.get_help()).map(ToString::to_string);
    let mut out = help.unwrap_or_default().replace('|', "\\|");
    let values = arg.get_possible_values();
    if arg.get_action().takes_values() && !values.is_empty() {
        let value = |value: &clap::builder::PossibleValue| match value.get_help() {
            Some(help) => format!("`{}`: {help}", value.get_name()),
            None => format!("`{}`", value.get_name()),
        };
        out.push_str(". ");
        out.push_str(&values.iter().map(value).collect::<Vec<_>>().join("; "));
    }
    let defaults: Vec<_> =
        arg.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
    if arg.get_action().takes_values() && !defaults.is_empty() {
        let _ = write!(out, " [default: {}]", defaults.join(","));
    }
    out
}

#[test]
fn page_of_the_command_line_is_that_of_the_arguments() {
    let page = fs::read_to_string(PAGE).unwrap_or_else(|error| panic!("{PAGE}: {error}"));
    let (head, made) = page.split_once(MARK).unwrap_or_else(|| panic!("{PAGE} has no line {MARK}"));
    let wanted = format!("\n{}", reference());
    if env::var_os("BEAMLET_WRITE_DOCS").is_some() {
        fs::write(PAGE, format!("{head}{MARK}{wanted}"))
            .unwrap_or_else(|error| panic!("{PAGE}: {error}"));
        return;
    }
    let differing = made.lines().zip(wanted.lines()).find(|(page, wanted)| page != wanted);
    assert!(
        made == wanted,
        "{PAGE} differs from the arguments; write it with BEAMLET_WRITE_DOCS=1\n{differing:#?}"
    );
}

/// Every document, by path.
fn documents() -> Vec<PathBuf> {
    let mut found = vec![PathBuf::from("README.md")];
    let mut folders = vec![PathBuf::from("docs")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "md") {
                found.push(path);
            }
        }
    }
    assert!(found.len() > 20, "only {} documents", found.len());
    found
}

/// Commands of shell blocks, and of code within a line, with their place.
struct Shown {
    place: String,
    words: Vec<String>,
    is_whole: bool,
}

fn commands_of(path: &Path) -> Vec<Shown> {
    let text =
        fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut found = Vec::new();
    let mut block: Option<bool> = None;
    let mut line_so_far = String::new();
    for (at, line) in text.lines().enumerate() {
        let place = format!("{}:{}", path.display(), at + 1);
        if let Some(language) = line.trim_start().strip_prefix("```") {
            block = if block.is_some() { None } else { Some(["sh", "bash"].contains(&language)) };
            continue;
        }
        match block {
            Some(false) => {}
            Some(true) => {
                line_so_far.push_str(line.trim_end_matches('\\'));
                if !line.ends_with('\\') {
                    found.extend(commands(&std::mem::take(&mut line_so_far), &place, true));
                }
            }
            None => line
                .split('`')
                .skip(1)
                .step_by(2)
                .filter(|code| code.starts_with("beamlet ") || code.starts_with("--"))
                .for_each(|code| found.extend(commands(code, &place, false))),
        }
    }
    found
}

/// The commands of a line of the shell that begin with the program, or with an option.
fn commands(line: &str, place: &str, is_whole: bool) -> Vec<Shown> {
    let mut found: Vec<Vec<String>> = vec![Vec::new()];
    let (mut word, mut is_word, mut quote) = (String::new(), false, None);
    for c in line.chars().chain([' ']) {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (Some(_), c) => word.push(c),
            (None, '\'' | '"') => (quote, is_word) = (Some(c), true),
            (None, '#') if !is_word => break,
            (None, ' ' | ';' | '&' | '>' | '(' | ')') => {
                if is_word {
                    found
                        .last_mut()
                        .into_iter()
                        .for_each(|words| words.push(std::mem::take(&mut word)));
                }
                is_word = false;
                if c != ' ' {
                    found.push(Vec::new());
                }
            }
            (None, c) => {
                word.push(c);
                is_word = true;
            }
        }
    }
    let starts = |words: &[String]| {
        words.iter().position(|word| word == "beamlet" || word.starts_with("--"))
    };
    let commands = found.into_iter().filter_map(|words| {
        let at = starts(&words).filter(|at| words[*at] == "beamlet" || (*at == 0 && !is_whole))?;
        // Pipes end a command; an alternative counts as its first word.
        let words = words[at..].iter().take_while(|word| *word != "|");
        let words: Vec<String> = words
            .map(|word| {
                word.trim_matches(['[', ']']).split('|').next().unwrap_or_default().to_owned()
            })
            .filter(|word| !word.starts_with('$') && word != "…" && !word.is_empty())
            .collect();
        Some(Shown { place: place.to_owned(), words, is_whole })
    });
    commands.collect()
}

/// Why the program does not accept a command.
fn problem(shown: &Shown) -> Option<String> {
    if shown.words[0].starts_with("--") {
        let option = shown.words[0].trim_start_matches('-').split('=').next()?;
        let known =
            |command: &Command| command.get_arguments().any(|arg| arg.get_long() == Some(option));
        let is_known = ["help", "version"].contains(&option) || verbs(&program()).any(known);
        return (!is_known).then(|| format!("no verb has --{option}"));
    }
    let error = Arguments::try_parse_from(&shown.words).err()?;
    let is_fragment = [
        ErrorKind::MissingRequiredArgument,
        ErrorKind::MissingSubcommand,
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand,
        ErrorKind::WrongNumberOfValues,
        ErrorKind::InvalidValue,
        ErrorKind::ValueValidation,
    ]
    .contains(&error.kind());
    let is_answer = [ErrorKind::DisplayHelp, ErrorKind::DisplayVersion].contains(&error.kind());
    (!is_answer && (shown.is_whole || !is_fragment)).then(|| error.to_string())
}

#[test]
fn commands_of_the_documents_and_of_the_help_are_accepted() {
    let mut shown: Vec<Shown> = documents().iter().flat_map(|path| commands_of(path)).collect();
    let documented = shown.iter().filter(|shown| shown.is_whole).count();
    for verb in verbs(&program()) {
        let place = format!("help of {}", verb.get_name());
        let text = examples(verb).0.join("\n").replace("\\\n", " ");
        text.lines().for_each(|line| shown.extend(commands(line, &place, true)));
    }
    let problems: Vec<_> = shown
        .iter()
        .filter_map(|shown| {
            Some(format!("{}: {}\n  {}", shown.place, shown.words.join(" "), problem(shown)?))
        })
        .collect();
    assert!(problems.is_empty(), "{}", problems.join("\n"));
    assert!(documented > 60 && shown.len() > 150, "only {documented} and {} commands", shown.len());
}

#[test]
fn commands_that_do_not_exist_are_found() {
    for line in [
        "beamlet simulat a.toml -o run",
        "beamlet simulate a.toml -o run --ressume",
        "x && beamlet view --what",
    ] {
        let found = commands(line, "", true);
        assert!(problem(&found[0]).is_some(), "{line}");
    }
    assert!(problem(&commands("--allow-mixd", "", false)[0]).is_some());
    assert!(problem(&commands("beamlet view run -o pictures # all", "", true)[0]).is_none());
}
