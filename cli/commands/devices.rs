//! `beamlet devices`: what Vulkan shows, usable or not, with the number that chooses it.

use crate::args::Devices;
use crate::failure::Failure;
use std::io::Write;

pub(super) fn run(arguments: &Devices, out: &mut impl Write) -> Result<(), Failure> {
    let devices = beamlet::devices()?;
    if arguments.json {
        return super::write_json(&devices, out);
    }
    for device in &devices {
        writeln!(out, "{}  {}", device.index, device.name)?;
        writeln!(out, "   driver     {}", device.driver)?;
        writeln!(out, "   memory     {} MiB", device.memory_bytes >> 20)?;
        writeln!(out, "   ray query  {}", if device.ray_query { "yes" } else { "no" })?;
        if let Some(problem) = &device.problem {
            writeln!(out, "   unusable   {problem}")?;
        }
    }
    Ok(())
}
