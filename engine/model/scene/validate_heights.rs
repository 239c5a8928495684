//! Requirements on masks whose apertures end along z, and on their steps along z.

use super::{MaskSpec, Scene, Scheme, Transport, limits};
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result};

impl Scene {
    /// True if apertures of a mask end along z.
    #[must_use]
    pub fn has_heights(&self) -> bool {
        self.masks().any(|(_, mask)| mask.heights().is_some())
    }

    /// Offsets along z are one for each mask step, of a mask that has edges along z.
    pub(super) fn validate_offsets_z(&self) -> Result<()> {
        let (offsets, steps) = (&self.scan.mask_offsets_z, self.scan.mask_offsets.len());
        if !offsets.is_empty() && offsets.len() != steps {
            let found = format!("{} offsets along z", offsets.len());
            return Err(Error::scene("scan.mask_offsets", found, format!("{steps}, as along x")));
        }
        self.far_along_z(offsets).map_or(Ok(()), |(step, found, allowed)| {
            Err(Error::scene(format!("scan.mask_offsets[{step}]"), found, allowed))
        })
    }

    /// First of some offsets along z that the sample mask cannot have, with what was found and what is allowed.
    pub(super) fn far_along_z(&self, offsets: &[f64]) -> Option<(usize, String, String)> {
        let heights = self.sample_mask.as_ref().and_then(MaskSpec::heights);
        let most = heights.map_or(0.0, |[_, period]| limits::OFFSET_PERIODS * period);
        let step = offsets.iter().position(|offset| offset.abs() > most)?;
        let found = format!("{} along z", Length.rounded(offsets[step]));
        let (found, allowed) = match heights {
            Some(_) => (found, format!("up to {} along z", Length.rounded(most))),
            None => {
                let allowed = "0 along z, or a sample mask whose apertures end along z (aperture_z, period_z or shape)";
                (format!("{found}, of a sample mask without edges along z"), allowed.to_owned())
            }
        };
        Some((step, found, allowed))
    }

    /// Refuses what cannot handle apertures with ends along z.
    pub(super) fn validate_heights(&self) -> Result<()> {
        let Some((table, mask)) = self.masks().find(|(_, mask)| mask.heights().is_some()) else {
            return Ok(());
        };
        let of = |key: &str, found: &str, allowed: &str| {
            Err(Error::scene(
                key,
                format!("{found} with {table} of apertures that end along z"),
                allowed,
            ))
        };
        if self.sampling.scheme == Scheme::Cells && self.sampling.transport == Transport::Wave {
            return of("sampling.transport", "\"wave\"", "\"auto\", \"first-order\" or \"exact\"");
        }
        let pixel = self.detector.pitch[1] * mask.distance / self.detector.distance;
        let most = limits::APERTURES_PER_PIXEL;
        for (table, mask) in self.masks() {
            let Some([height, period]) = mask.heights() else { continue };
            if pixel / period > most {
                let allowed = format!("at least {}", Length.rounded(pixel / most));
                return Err(Error::scene(
                    format!("{table}.period_z"),
                    Length.rounded(period),
                    allowed,
                ));
            }
            self.validate_shadow(table, mask, height)?;
        }
        Ok(())
    }

    /// Bars of apertures that end along z cast shadows narrower than each bar and aperture.
    fn validate_shadow(&self, table: &str, mask: &MaskSpec, height: f64) -> Result<()> {
        let [_, period] = mask.heights().unwrap_or_default();
        let detector = &self.detector;
        let edges = [[mask.period, mask.aperture], [period, height]];
        for (axis, [period, aperture]) in edges.into_iter().enumerate() {
            let slope =
                0.5 * detector.pitch[axis] * f64::from(detector.pixels[axis]) / detector.distance;
            let shadow = slope * mask.body.thickness();
            let bar = period - aperture;
            let narrowest = if bar > 0.0 { bar.min(aperture) } else { aperture };
            if shadow > limits::SHADOW_OF_HEIGHTS * narrowest {
                let found = format!(
                    "{}, whose shadow at the edge of the detector, {}, is wide",
                    Length.rounded(mask.body.thickness()),
                    Length.rounded(shadow)
                );
                let allowed = format!(
                    "a shadow up to {} of the narrowest bar or aperture, {}, for apertures that end along z",
                    limits::SHADOW_OF_HEIGHTS,
                    Length.rounded(narrowest)
                );
                return Err(Error::scene(format!("{table}.thickness"), found, allowed));
            }
        }
        Ok(())
    }
}
