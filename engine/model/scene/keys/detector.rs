//! Keys of the detector.

use super::prelude::*;
use crate::scene::detector::{
    Absorber, Blur, Counts as Noise, Detector, DetectorMode, KernelFile, Photons, Scatter,
};

/// Photons of an open pixel: beyond this f64 does not resolve neighbouring counts.
const PHOTONS: f64 = 1e12;
/// Longest exposure of a frame, s.
const EXPOSURE: f64 = 1e7;

keys! { DETECTOR: Detector, "detector",
    [Forms(&[&["photons"], &["exposure"]], 0),
     With(&["threshold_low", "threshold_high"], "mode",
          "no threshold, or mode = \"counting\""),
     With(&["electronic_noise", "swank", "gain", "offset", "bit_depth"], "photons",
          "this key only together with detector.photons or detector.exposure, which make counts")],
    ["pixelsize" => "pitch", "pixel_size" => "pitch", "pixel_pitch" => "pitch",
     "size" => "pixels", "shape" => "pixels", "resolution" => "pixels", "psf" => "blur",
     "noise" => "photons", "counts" => "photons", "bits" => "bit_depth",
     "time" => "exposure", "exposure_time" => "exposure",
     "scintillator" => "absorber", "sensor" => "absorber"];
    distance => Quantity(Length, POSITIVE), Required, r#""1.8 m""#,
        "Distance from the source to the detector, more than to the rotation centre.";
    pixels => Counts("columns and rows", 1, limits::PIXELS as u64), Required, "[128, 128]",
        "Columns and rows.";
    pitch => Pair(POSITIVE), Required, r#""150 um""#, "Distance from pixel to pixel.";
    mode => Word(MODES), Default(r#""counting""#), r#""integrating""#,
        "Contribution of a photon to the signal: one count, or its energy.";
    threshold_low at Detector { mode: DetectorMode::Counting { low: threshold_low, .. }, .. } =>
        Quantity(Energy, POSITIVE), Without("none"), r#""20 keV""#,
        "Photons below are not counted; counting only, up to the highest energy of the beam.";
    threshold_high at Detector { mode: DetectorMode::Counting { high: threshold_high, .. }, .. } =>
        Quantity(Energy, POSITIVE), Without("none"), r#""60 keV""#,
        "Photons above are not counted; counting only, above `threshold_low`, up to the highest energy of the beam.";
    absorber => Inner(&ABSORBER.spec), Without("absorbs every photon"),
        r#"{ material = "CsI", thickness = "600 um" }"#, "Scintillator or sensor.";
    blur => Inner(&BLUR.spec), Without("none"), r#"{ fwhm = "80 um" }"#,
        "Blur of the light behind the detector mask.";
    scatter => Inner(&SCATTER.spec), Without("none"), r#"{ image = "scatter.tif" }"#,
        "Light that is added to the simulated one.";
    photons at Detector { counts: Some(Noise { photons: Photons::Number(photons), .. }), .. } =>
        Number("a number of photons", POSITIVE.up_to(PHOTONS)), Without("none: no counts"), "20000",
        "Mean number of photons that a pixel without masks and sample detects in a frame.";
    exposure at Detector { counts: Some(Noise { photons: Photons::Exposure(exposure), .. }), .. } =>
        Quantity(Time, POSITIVE.up_to(EXPOSURE)), Without("none: no counts"), r#""2 s""#,
        "Exposure time of a frame, which gives the photons of the built-in tube at `source.current`.";
    electronic_noise at Detector { counts: Some(Noise { electronic_noise, .. }), .. } =>
        Number("a number", NOT_NEGATIVE), Default("0.0"), "3.5",
        "Standard deviation of the electronic noise, detector numbers.";
    swank at Detector { counts: Some(Noise { swank, .. }), .. } =>
        Number("a number", POSITIVE.up_to(1.0)), Default("1.0"), "0.85",
        "Swank factor; below 1 only for integrating detectors.";
    gain at Detector { counts: Some(Noise { gain, .. }), .. } =>
        Number("a number", POSITIVE), Default("1.0"), "0.5", "Detector numbers per photon.";
    offset at Detector { counts: Some(Noise { offset, .. }), .. } =>
        Number("a number", ANY), Without("0; with `bit_depth` 8.3 × `electronic_noise`, rounded up"), "100",
        "Detector number without light; with `bit_depth` a warning below 4 × `electronic_noise`.";
    bit_depth at Detector { counts: Some(Noise { bit_depth, .. }), .. } =>
        Count(1, limits::BIT_DEPTH as u64), Without("none: not rounded, not clipped"), "16",
        "Bits of a detector number.";
}

words!(DetectorMode, MODES:
    "counting" => Counting { low: None, high: None }, "integrating" => Integrating);

impl Record for Detector {
    const KEYS: &'static Keys<Self> = &DETECTOR;

    fn begin(has: &dyn Fn(&str) -> bool) -> Self {
        let counts = match (has("photons"), has("exposure")) {
            (true, _) => Some(Noise::of_photons(f64::NAN)),
            (false, true) => Some(Noise::of_exposure(f64::NAN)),
            (false, false) => None,
        };
        Self { counts, ..Self::new(f64::NAN, [1; 2], [f64::NAN; 2]) }
    }

    fn finish(&mut self, _: &Table<'_>) -> Result<()> {
        *self = resolved(self);
        Ok(())
    }

    fn relations(&self, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        if let DetectorMode::Counting { low: Some(low), high: Some(high) } = self.mode
            && low >= high
        {
            let allowed = format!("more than threshold_low, {}", Energy.rounded(low));
            faults.add(Error::scene(key("threshold_high"), Energy.rounded(high), allowed));
        }
        if let Some(Blur::Gaussian { sigma }) = &self.blur {
            let mut wide =
                sigma.iter().zip(self.pitch).map(|(it, pitch)| (*it, limits::BLUR * pitch));
            if let Some((sigma, most)) = wide.find(|(sigma, most)| sigma > most) {
                let allowed =
                    format!("no more than {} pixels, {}", limits::BLUR, Length.rounded(most));
                let fwhm = sigma * (8.0 * std::f64::consts::LN_2).sqrt();
                let [sigma, fwhm] = [sigma, fwhm].map(|width| Length.rounded(width));
                let found = format!("{sigma}, a full width at half maximum of {fwhm}");
                faults.add(Error::scene(key("blur.sigma"), found, allowed));
            }
        }
        if let Some(Noise { swank, .. }) = self.counts
            && (0.0..1.0).contains(&swank)
            && self.mode != DetectorMode::Integrating
        {
            let found = format!("{swank:?} with mode = \"counting\"");
            let allowed = "1, as each counted photon is one count; or mode = \"integrating\"";
            faults.add(Error::scene(key("swank"), found, allowed));
        }
    }
}

/// The detector with the offset that its noise and bit depth need.
pub(crate) fn resolved(detector: &Detector) -> Detector {
    let counts = detector.counts.map(|counts| counts.with_offset(counts.number_without_light()));
    Detector { counts, ..detector.clone() }
}

/// Refuses thresholds beyond the highest energy of the beam, keV.
///
/// # Errors
/// [`Error::Scene`] with the key of the threshold.
pub fn validate_thresholds(detector: &Detector, highest: f64) -> Result<()> {
    let DetectorMode::Counting { low, high } = detector.mode else { return Ok(()) };
    for (key, threshold) in [("threshold_low", low), ("threshold_high", high)] {
        let Some(threshold) = threshold.filter(|threshold| *threshold > highest) else { continue };
        return Err(Error::scene(
            format!("detector.{key}"),
            Energy.rounded(threshold),
            format!("no more than the highest energy of the beam, {}", Energy.rounded(highest)),
        ));
    }
    Ok(())
}

keys! { ABSORBER: Absorber, "detector.absorber", [], [];
    material => MATERIAL, Required, r#""CsI""#, "Material of the layer.";
    thickness => Quantity(Length, POSITIVE), Required, r#""600 um""#, "Thickness along the beam.";
}

impl Record for Absorber {
    const KEYS: &'static Keys<Self> = &ABSORBER;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        Self::new("", f64::NAN)
    }
}

keys! { BLUR: Blur, "detector.blur", [Forms(&[&["kernel", "pixel"], &["fwhm"], &["sigma"]], 2)], [];
    sigma at Blur::Gaussian { sigma } => Pair(NOT_NEGATIVE), Required, r#"["40 um", "30 um"]"#,
        "Standard deviation of a Gaussian, up to 100 pixels.";
    fwhm by hand => Pair(NOT_NEGATIVE), Required, r#""80 um""#,
        "Full width at half maximum of a Gaussian, up to 235 pixels.";
    kernel at Blur::Kernel(KernelFile { path: kernel, .. }) => IMAGE, Required, r#""psf.tif""#,
        "Image of a point: one grey channel, values >= 0, up to 100 pixels of the detector wide.";
    pixel at Blur::Kernel(KernelFile { pixel, .. }) => Pair(POSITIVE), Required, r#""10 um""#,
        "Size of the pixels of the image on the detector.";
}

impl Record for Blur {
    const KEYS: &'static Keys<Self> = &BLUR;

    fn begin(has: &dyn Fn(&str) -> bool) -> Self {
        match has("kernel") || has("pixel") {
            true => Self::Kernel(KernelFile::new("", [f64::NAN; 2])),
            false => Self::Gaussian { sigma: [f64::NAN; 2] },
        }
    }

    fn finish(&mut self, table: &Table<'_>) -> Result<()> {
        if let Some(mut fwhm) = optional::<[f64; 2]>(table, "fwhm")? {
            refuse_beyond(table, "fwhm", &mut fwhm)?;
            let scale = 1.0 / (8.0 * std::f64::consts::LN_2).sqrt();
            *self = Self::Gaussian { sigma: fwhm.map(|width| width * scale) };
        }
        Ok(())
    }
}

keys! { SCATTER: Scatter, "detector.scatter",
    [Forms(&[&["image"], &["kernel", "pixel", "fraction"]], 1)], [];
    image at Scatter::Image(image) => IMAGE, Required, r#""scatter.tif""#,
        "Image in units of open beam, added to frames with the sample: one grey channel, values >= 0.";
    kernel at Scatter::Kernel { kernel: KernelFile { path: kernel, .. }, .. } =>
        IMAGE, Required, r#""veil.npy""#,
        "Kernel that spreads the light of the pixels, as for the blur, up to 2000 pixels.";
    pixel at Scatter::Kernel { kernel: KernelFile { pixel, .. }, .. } =>
        Pair(POSITIVE), Required, r#""1 mm""#, "Size of the pixels of the kernel on the detector.";
    fraction at Scatter::Kernel { fraction, .. } =>
        Number("a number", POSITIVE), Required, "0.05", "Scattered light over the light that scatters.";
}

impl Record for Scatter {
    const KEYS: &'static Keys<Self> = &SCATTER;

    fn begin(has: &dyn Fn(&str) -> bool) -> Self {
        let kernel = KernelFile::new("", [f64::NAN; 2]);
        match has("image") {
            true => Self::Image(PathBuf::new()),
            false => Self::Kernel { kernel, fraction: f64::NAN },
        }
    }
}
