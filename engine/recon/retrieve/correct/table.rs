//! corrections.csv: the corrections of a retrieval, a line for each frame.

use super::chosen::{Plane, ViewCorrection};
use std::fmt::Write;

/// Names of the columns.
const HEADER: &str = "view,step,mask_offset_m,displacement_m,displacement_sigma_m,dose,dose_sigma,\
    refraction_rad,refraction_sigma_rad,slope_x_rad_per_m,slope_x_sigma_rad_per_m,\
    slope_z_rad_per_m,slope_z_sigma_rad_per_m";
/// Names of further columns in two directions.
const HEADER_Z: &str = ",displacement_z_m,displacement_z_sigma_m,refraction_z_rad,refraction_z_sigma_rad,\
    refraction_z_slope_x_rad_per_m,refraction_z_slope_x_sigma_rad_per_m,refraction_z_slope_z_rad_per_m,\
    refraction_z_slope_z_sigma_rad_per_m";

/// The text of the table; a value that was not corrected or is unknown is left empty. `offsets`: of the
/// frames of each view, m.
pub(crate) fn table(views: &[ViewCorrection], offsets: impl Fn(usize) -> Vec<f64>) -> String {
    let has_z = views.iter().any(|of| of.offset_z.is_some() || !of.steps_z.is_empty());
    let mut text = format!("{HEADER}{}\n", if has_z { HEADER_Z } else { "" });
    for (view, of) in views.iter().enumerate() {
        let offsets = offsets(view);
        let frames = offsets.len().max(of.dose.len()).max(of.steps.len()).max(1);
        for frame in 0..frames {
            let mut line = vec![view.to_string(), frame.to_string()];
            line.push(offsets.get(frame).map_or(String::new(), |at| format!("{at:e}")));
            let of_frame = |list: &[Option<[f64; 2]>]| list.get(frame).copied().flatten();
            let slopes = |plane: Option<Plane>| {
                [plane.map(|plane| plane.x), plane.and_then(|plane| plane.z)]
            };
            let ([x, z], [z_x, z_z]) = (slopes(of.plane), slopes(of.plane_z));
            let along_x = [of_frame(&of.steps), of_frame(&of.dose), of.offset, x, z];
            let along_z = [of_frame(&of.steps_z), of.offset_z, z_x, z_z];
            for pair in along_x.into_iter().chain(along_z.into_iter().filter(|_| has_z)) {
                match pair {
                    Some([value, sigma]) => line.extend([value, sigma].map(|of| format!("{of:e}"))),
                    None => line.extend([String::new(), String::new()]),
                }
            }
            let _ = writeln!(text, "{}", line.join(","));
        }
    }
    text
}
