//! Warnings of scenes outside ray optics.

use super::text::{lengths, percent, short_length};
use super::{DARK_FIELD, FLAT, FlatLimits, ObjectLimits, RayLimits, WaveTransport};
use crate::check::display::length;

impl RayLimits {
    /// Warning where rays err by more than 1 % of the peak of the flat, or by 10 % of dark fields, with the key
    /// that mends it; none where the scene is computed by waves.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let by_waves = match &self.waves {
            WaveTransport::Used => return None,
            WaveTransport::Possible => r#"sampling.transport = "wave" computes it"#.into(),
            WaveTransport::Refused(found) => {
                format!("sampling.transport = \"wave\" would compute it, but refuses {found}")
            }
        };
        let flat = self.flat.as_ref().filter(|flat| flat.relative > FLAT).map(flat);
        let all: Vec<String> =
            flat.into_iter().chain(self.objects.iter().filter_map(object)).collect();
        (!all.is_empty()).then(|| format!("{}; {by_waves}", all.join("; ")))
    }
}

fn flat(flat: &FlatLimits) -> String {
    let [offset, _, error] = flat.worst();
    let spot = flat.least_spot.map(|spot| format!("a focal spot of {}", short_length(spot)));
    let nearer = flat
        .distance_factor
        .map(|factor| format!("all distances reduced to {} of their length", percent(factor)));
    let remedies: Vec<String> = [spot, nearer].into_iter().flatten().collect();
    let remedy = match remedies.is_empty() {
        true => String::new(),
        false => format!("; {} would bring it below {}", remedies.join(" or "), percent(FLAT)),
    };
    format!(
        "the set-up is outside ray optics: by waves the flat differs by {error:.1e} of open beam at a mask offset \
         of {}, {} of the peak{remedy}",
        length(offset),
        percent(flat.relative)
    )
}

fn object(object: &ObjectLimits) -> Option<String> {
    let [low, high] = object.dark_field?;
    let is_off = |ratio: f64| (1.0 / ratio - 1.0).abs() > DARK_FIELD;
    if !is_off(low) && !is_off(high) {
        return None;
    }
    Some(format!(
        "\"{}\" is outside ray optics: the dark field of bodies of {} by rays is {} the one by waves; \
         distances, apertures and spot hardly change this",
        object.name,
        object.diameters.map_or_else(String::new, lengths),
        times([low, high])
    ))
}

/// Rays over waves, as "2.1 times".
fn times([low, high]: [f64; 2]) -> String {
    let [a, b] = [high, low].map(|ratio| format!("{:.1}", 1.0 / ratio));
    if a == b { format!("{a} times") } else { format!("{a} to {b} times") }
}
