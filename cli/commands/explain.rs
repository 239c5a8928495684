//! `beamlet explain`: the pages of docs/errors, which messages of errors name.

use crate::args::Explain;
use crate::failure::Failure;
use std::io::Write;

/// Page of a kind of error.
struct Page {
    kind: &'static str,
    text: &'static str,
}

const PAGES: [Page; 4] = [
    Page { kind: "device", text: include_str!("../../docs/errors/device.md") },
    Page { kind: "memory", text: include_str!("../../docs/errors/memory.md") },
    Page { kind: "mesh", text: include_str!("../../docs/errors/mesh.md") },
    Page { kind: "rays", text: include_str!("../../docs/errors/rays.md") },
];

pub(super) fn run(arguments: &Explain, out: &mut impl Write) -> Result<(), Failure> {
    let Some(kind) = &arguments.kind else {
        for page in &PAGES {
            let title = page.text.lines().next().unwrap_or_default();
            writeln!(out, "{:6}  {}", page.kind, title.trim_start_matches("# "))?;
        }
        return Ok(());
    };
    let page = PAGES.iter().find(|page| page.kind == kind).ok_or_else(|| {
        let kinds = PAGES.each_ref().map(|page| page.kind).join(", ");
        Failure::Usage(format!("no kind of error is named '{kind}'; allowed: {kinds}"))
    })?;
    Ok(write!(out, "{}", page.text)?)
}
