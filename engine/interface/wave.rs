//! Inputs of the wave stages: lines of rays along x as fields, and the light of their pairs.

shared_structs! {
    /// Structs of the wave stages.
    pub(super) LAYOUTS;

    /// Effect of a material on the field at one energy.
    pub struct WaveMaterial in WaveMaterials(readonly) {
        /// Phase, cycles per metre of path: high and low part.
        pub cycles: f32,
        pub cycles_low: f32,
        /// Half of the attenuation coefficient, 1/m.
        pub half_mu: f32,
        /// Displacement in the plane of the sample mask per lever moment.
        pub delta: f32,
        /// Variance of the displacement in the plane of the sample mask per moment of scattering.
        pub scattering: f32,
        /// Index of the law by which its contrast depends on the shear.
        pub law: u32,
    }

    /// Field behind the sample at one ray.
    pub struct WaveField in WaveFields {
        pub re: f32,
        pub im: f32,
        /// Displacement by the depth of the sample along the axis, in the plane of the sample mask, m.
        pub displacement: f32,
    }

    /// Sum of the products of pairs up to a ray.
    pub struct WavePair in WavePairs {
        pub re: f32,
        pub im: f32,
    }

    /// A line of rays of a beamlet.
    pub struct WaveLine in WaveLines(readonly) {
        /// Index of the first ray in the field; `WAVE_EMPTY` for a line that misses the sample.
        pub first_ray: u32,
        /// Index of the beamlet.
        pub beamlet: u32,
    }

    /// Aperture of a beamlet at mask offset 0 and its pixels, in cells of the line from its centre.
    pub struct WaveBeamlet in WaveBeamlets(readonly) {
        pub low: f32,
        pub high: f32,
        /// Narrowing of the aperture on either side by a mask offset, share of the offset.
        pub tilt: f32,
        /// Variance of soft edges of both masks.
        pub variance: f32,
        /// Index of its first pixel among the rows of the table of responses.
        pub first_target: u32,
        pub target_count: u32,
    }

    /// Lines at one energy. Lengths are in cells (spacings of the rays).
    pub struct WaveParams in WaveParamsRef(readonly) {
        /// Address of `WaveBeamlets`.
        pub beamlets: u64,
        /// Address of `Words`: row of the responses of each pixel of a beamlet.
        pub targets: u64,
        /// Address of `WavePairs`, `[row][shear]`: effect of a frequency on a pixel.
        pub responses: u64,
        /// Address of `WavePairs`, `[shear]`: motion of the sample against the mask by the focal spot, in cells.
        pub motions: u64,
        /// Address of `Floats`, `[shear][law]`: variance by which light loses contrast, over that of the ray.
        pub laws: u64,
        /// Rays of a line, even.
        pub rays: u32,
        /// Number of shears, 0 included.
        pub shears: u32,
        /// Shear of the sample per frequency, cells.
        pub pairs: u32,
        /// Frequency per cell, 2^-32 cycles.
        pub turn: u32,
        /// Most pixels of a beamlet: stride of the light.
        pub target_stride: u32,
        /// Apertures that one is paired with beside itself, on the high side.
        pub neighbours: u32,
        /// Shear of the sample mask per frequency, cells.
        pub mask_shear: f32,
        /// Period of the sample mask, cells.
        pub period: f32,
        /// Cells per metre.
        pub cells: f32,
        /// Frequency step, cycles per metre.
        pub frequency: f32,
        /// Amplitude that the bars of the sample mask transmit.
        pub bars: f32,
    }

    /// Push constants of `wave/field.comp`.
    pub struct WaveFieldPush {
        /// `[ray][word]`.
        pub moments: u64 => Floats,
        pub fields: u64 => WaveFields,
        pub materials: u64 => WaveMaterials,
        /// `[ray][law]`: variance of the displacement along x by materials that scatter, in the plane of the sample
        /// mask, m2.
        pub variances: u64 => Floats,
        /// Rays of this dispatch.
        pub ray_count: u32,
        /// Place of the first in the field.
        pub first: u32,
        /// Words of the moments of a ray.
        pub words: u32,
        pub material_count: u32,
        /// Words of scattering, the last ones of a ray: as many as materials, or none.
        pub scattering_words: u32,
        /// Laws of materials that scatter; 0 without any.
        pub laws: u32,
        /// Centre of the sample to the analyser, m.
        pub lever: f32,
    }

    /// Push constants of `wave/line.comp`.
    pub struct WaveLinePush {
        pub params: u64 => WaveParamsRef,
        pub lines: u64 => WaveLines,
        pub fields: u64 => WaveFields,
        /// As of the fields: `[ray][law]`.
        pub variances: u64 => Floats,
        /// `[line of the dispatch][ray]`.
        pub sums: u64 => WavePairs,
        /// Offsets of the sample mask, m.
        pub offsets: u64 => Offsets,
        /// `[line][step][pixel of the beamlet]`.
        pub light: u64 => Floats,
        pub first_line: u32,
        pub steps: u32,
        /// Nonzero: the light of other energies is kept.
        pub adds: u32,
        /// Laws of materials that scatter.
        pub laws: u32,
    }
}
