//! Inputs of the light stages.

shared_structs! {
    /// Structs of the light stages.
    pub(super) LAYOUTS;

    /// An open interval of a mask, relative to the centre of its period, in the plane where the
    /// mask is evaluated (the cell plane or the analyser).
    pub struct Aperture in Apertures(readonly) {
        pub low: f32,
        pub high: f32,
    }

    /// A layer of the bars of a mask, from the source on.
    pub struct BarLayer in BarLayers(readonly) {
        /// Share of the thickness of the bars.
        pub thickness: f32,
        /// Share of their attenuation.
        pub attenuation: f32,
    }

    /// A mask as the light stages see it.
    pub struct Mask {
        /// Address of `Apertures`: of one period, sorted.
        pub apertures: u64,
        /// Address of `BarLayers`.
        pub bar_layers: u64,
        pub bar_layer_count: u32,
        pub count: u32,
        pub present: u32,
        pub period: f32,
        /// Times the magnification from the mask to the plane of evaluation.
        pub thickness: f32,
        /// mu * thickness; 0 for a sheet.
        pub attenuation: f32,
        /// Transmission of a sheet's bars.
        pub transmission: f32,
        /// Over energies: bars are opaque, and each cell has how much they narrow apertures.
        pub averaged: u32,
        /// Variance of the edges of an averaged mask, in squared shadow widths.
        pub edge_variance: f32,
        /// Low end of the first aperture.
        pub first: f32,
        /// High end of the last aperture.
        pub last: f32,
        /// Width of the narrowest aperture and of the narrowest bar, if there are several.
        pub narrowest_aperture: f32,
        pub narrowest_bar: f32,
        /// Attenuation of the substrate along the axis; 0 for light of all energies together.
        pub substrate: f32,
        /// dx/dy of the walls of the bars: slits are wider at the face towards the detector where it is above 0.
        pub taper: f32,
    }

    /// A strip of a mask whose apertures end along z: between its ends light passes its apertures along x.
    pub struct MaskStrip in MaskStrips(readonly) {
        /// Address of `Apertures`: its own, of one period, sorted.
        pub apertures: u64,
        pub count: u32,
        /// High end of its last aperture.
        pub last: f32,
        /// Ends, rows downwards from the centre of the period.
        pub top: f32,
        pub bottom: f32,
        /// Middle of its aperture along z: ends above it and ends below it move towards it by the shadows of bars.
        pub middle: f32,
    }

    /// Strips of a mask as the light stages see them, in rows as seen from the source on the detector.
    pub struct MaskHeights {
        /// Address of `MaskStrips`: of one period, upper strips first.
        pub strips: u64,
        /// Strips; 0 where the mask has no edges along z.
        pub count: u32,
        /// Rows.
        pub period: f32,
        /// Thickness of the bars, rows.
        pub thickness: f32,
        /// Mean displacement of an edge into its aperture, in shadows of the bars.
        pub inset: f32,
        /// Variance of an edge, in squared shadows of the bars.
        pub variance: f32,
        /// Share of a period that lies in strips.
        pub open: f32,
    }

    /// Values that depend on the row alone.
    pub struct RowGeometry in RowTable(readonly) {
        /// Centre of a period of the sample mask along z below the upper end of the row, rows.
        pub sample_offset: f32,
        /// The same of the detector mask.
        pub aperture_offset: f32,
    }

    /// Parameters of the light stages for masks whose apertures end along z, for one part of the focal spot.
    /// Lengths are rows on the detector, downwards.
    pub struct HeightParams in HeightParamsRef(readonly) {
        pub sample_mask: MaskHeights,
        pub detector_mask: MaskHeights,
        /// Address of `RowTable`.
        pub rows: u64,
        /// Address of `Offsets`: of the sample mask along z, per step.
        pub offsets: u64,
        /// First row of the table.
        pub first_row: i32,
        /// Shift of a place in the sample against the sample mask.
        pub mask_shift: f32,
        /// Shift of light against the edges of the detector mask.
        pub analyser_shift: f32,
        /// Blur at the sample mask of a fixed place in the sample, standard deviation.
        pub mask_blur: f32,
        /// Blur at the detector mask of what lies at the rotation centre, standard deviation.
        pub analyser_blur: f32,
        /// Displacement at the detector mask over that on the detector.
        pub analyser_share: f32,
    }

    /// Values that depend on the beamlet (index k of the cell lattice) alone.
    pub struct BeamletGeometry in BeamletTable(readonly) {
        /// Where its centre lands without deflection.
        pub pixel: i32,
        /// Landing point less the pixel's centre, on the analyser, m.
        pub pixel_offset: f32,
        /// Landing point less the centre of the nearest detector-mask period.
        pub aperture_offset: f32,
        /// Cell-lattice centre less the nearest sample-mask period's, m.
        pub sample_offset: f32,
        /// dx/dy of its centre ray.
        pub slope: f32,
    }

    /// Cells of one beamlet in one interval of z.
    pub struct CellRow in CellRows(readonly), CellRowsOut {
        pub first_cell: u32,
        pub cell_count: u32,
        /// Index of the beamlet.
        pub column: u32,
        pub row: i32,
        /// Within the row, 0..1 downwards.
        pub top: f32,
        pub bottom: f32,
        /// Number of equal rows from this one on.
        pub rows: u32,
        /// That its cells let through, as a length of the open beam, m.
        pub light: f32,
        /// Least displacement at the analyser, against the edges of pixels, m.
        pub low_landing: f32,
        pub high_landing: f32,
        /// Largest variance of the displacement, m2, and of the light of narrow cells.
        pub displacement_variance: f32,
        /// Largest change of the displacement per metre, narrow cells apart.
        pub displacement_slope: f32,
    }

    /// A cell: x interval in the cell plane, relative to the beamlet's centre; results at its ends.
    pub struct Cell in Cells(readonly), CellsOut {
        pub x_low: f32,
        pub x_high: f32,
        pub depth_low: f32,
        pub depth_high: f32,
        /// At the analyser.
        pub displacement_low: f32,
        pub displacement_high: f32,
        /// At the detector, mean.
        pub displacement_z: f32,
        /// Share that lands in the row above; -1: farther, to be computed. Behind masks whose apertures end
        /// along z: growth of the landing over the height of the cell, rows.
        pub share_above: f32,
        /// Share that lands in the row below; 0 where it is to be computed. Behind masks whose apertures end along z:
        /// change of the light over the height, relative to the mean light.
        pub share_below: f32,
        /// Shift of pixel edges on the analyser, from the gap to the detector.
        pub pixel_shift: f32,
        /// Variance of the displacement by energies, roughness and facets, independent of the place in the cell, m2.
        pub displacement_variance: f32,
        /// Share of the shadow width that narrows apertures, of averaged masks.
        pub sample_narrowing: f32,
        pub detector_narrowing: f32,
        /// Covariance over energies of that share and the displacement, m.
        pub sample_covariance: f32,
        pub detector_covariance: f32,
    }

    /// Cells of a cell row that one invocation illuminates.
    pub struct CellRowPart in CellRowParts(readonly) {
        /// Index of the cell row.
        pub cell_row: u32,
        /// First cell, counted from the first of the cell row.
        pub first: u32,
        /// End of the cells (exclusive); may lie behind the last of the cell row.
        pub last: u32,
    }

    /// Energies of a scene, and how far one cell may stand for several.
    pub struct EnergyParams in EnergyParamsRef(readonly) {
        /// Address of `Floats`: the words of the moments of variances, then `[energy]`: refraction relative to the mean
        /// constants, mu and delta of each material, and a factor for each moment of a variance. Behind the energies the
        /// mean constants.
        pub constants: u64,
        pub energies: u32,
        /// Ways through the masks.
        pub groups: u32,
        pub materials: u32,
        /// Words of the moments of a ray.
        pub moment_words: u32,
        /// Moments of variances.
        pub variances: u32,
        /// Apertures end along z.
        pub heights: u32,
        /// Width of the widest cell that needs all of the accuracy, m.
        pub full_width: f32,
        /// Tolerance of displacements on the analyser, m.
        pub tolerance: f32,
        /// Largest standard deviation of the displacement over the energies of a cell, m: along x on the analyser.
        pub spread_x: f32,
        /// Along z on the detector.
        pub spread_z: f32,
        /// From analyser to detector, m.
        pub gap: f32,
        /// Analyser / detector distance.
        pub ratio: f32,
        /// Height of a row on the detector, m.
        pub row_pitch: f32,
        /// Standard deviation of the blur over rows, rows.
        pub row_blur: f32,
    }

    /// Results of the rays at the ends of a cell at one energy.
    pub struct EnergyResult in EnergyResults {
        pub depth_low: f32,
        pub depth_high: f32,
        /// Share of the light that passes in the middle.
        pub light: f32,
        /// Displacement at the analyser, m.
        pub x_low: f32,
        pub x_high: f32,
        /// Mean displacement at the detector, m.
        pub z: f32,
        /// Mean change of slope.
        pub slope_x: f32,
        /// Variance of the displacement along x, m2.
        pub variance: f32,
    }

    /// Effect of the masks on a cell row, and its places among gathered cells.
    pub struct EnergyRow in EnergyRows(readonly) {
        /// First word of the effect of the masks at its place: `[group][energy]` shares, `[energy]` shares of all groups,
        /// `[energy][mask]` narrowing, `[group]` first energy, end of the energies, and limits of joined cells: width (< 0:
        /// none are joined), residual, change.
        pub bars: u32,
        /// First of its gathered cells.
        pub first_cell: u32,
    }

    /// Push constants of `light/energies.comp`.
    pub struct EnergiesPush {
        pub params: u64 => EnergyParamsRef,
        pub cells: u64 => Cells,
        /// `[cell][end][word]`: moments of the rays at the ends of cells.
        pub moments: u64 => Floats,
        /// `[cell]`: number of the exact cell, from 1; 0 for others.
        pub exact: u64 => Words,
        /// `[exact cell][end]` at the mean constants, and results at single energies.
        pub rays: u64 => RayResults,
        /// `[exact cell][energy]`: index of the result at this energy; 0: none.
        pub repeated: u64 => Words,
        /// `[cell][energy]`.
        pub results: u64 => EnergyResults,
        pub cell_count: u32,
        /// 0: cells without a sample.
        pub has_moments: u32,
    }

    /// Push constants of `light/gather.comp`.
    pub struct GatherPush {
        pub params: u64 => EnergyParamsRef,
        pub cell_rows: u64 => CellRows,
        pub energy_rows: u64 => EnergyRows,
        pub cells: u64 => Cells,
        /// `[cell][energy]`.
        pub results: u64 => EnergyResults,
        pub bars: u64 => Floats,
        pub gathered: u64 => CellsOut,
        /// `[list]`: all rows, then those of light that may land far.
        pub gathered_rows: u64 => CellRowsOut,
        pub row_count: u32,
        /// Number of the first rows whose light may land far.
        pub far_count: u32,
        /// A list for each energy; otherwise for each group.
        pub by_energy: u32,
    }

    /// A Gaussian of the focal spot.
    pub struct SpotPart in SpotParts(readonly) {
        /// Share of the light in this part and those before it; more than 1 in the last.
        pub below: f32,
        /// Offset from the optical axis, m.
        pub x: f32,
        pub z: f32,
        /// M.
        pub deviation_x: f32,
        pub deviation_z: f32,
    }

    /// Parameters of the light stages for a band, for cells of one part of the focal spot. An element at
    /// an offset moves against the rays from the source centre, in which cells are given
    /// (docs/physics.md, "Focal spot").
    pub struct IlluminationParams in IlluminationParamsRef(readonly) {
        pub sample_mask: Mask,
        pub detector_mask: Mask,
        /// Address of `BeamletTable`.
        pub beamlets: u64,
        /// Address of `Offsets`: of the sample mask, per step, m.
        pub offsets: u64,
        /// Address of `SpotParts`: for random draws.
        pub spot_parts: u64,
        /// Address of `HeightParams`, of masks whose apertures end along z.
        pub heights: u64,
        /// Cell plane to analyser.
        pub magnification: f32,
        /// Shift of a place in the sample against the sample mask, m.
        pub mask_shift: f32,
        /// Shift of the detector mask's edges against the light of a cell, m.
        pub landing_shift: f32,
        /// The same of pixel edges, seen on the analyser.
        pub pixel_shift: f32,
        /// Shift of the slope of rays, downwards.
        pub slope_shift: f32,
        /// Shift of light, rows downwards.
        pub row_shift: f32,
        /// Blur on the analyser of what lies at the rotation centre, m, std.
        pub spot: f32,
        /// The same at edges of pixels, seen on the analyser.
        pub pixel_spot: f32,
        /// Std of x at the sample mask for a fixed place in the sample, m.
        pub mask_blur: f32,
        /// Distance from the source.
        pub cell_plane: f32,
        /// Distance from the source.
        pub analyser: f32,
        /// Analyser / detector distance.
        pub ratio: f32,
        /// On the analyser.
        pub pixel_pitch: f32,
        /// Intensity per metre of the cell plane.
        pub weight: f32,
        /// Standard deviation of the blur over rows, rows.
        pub row_blur: f32,
        /// Height of a row on the detector, m.
        pub row_pitch: f32,
        /// Slope dz/dy per row, downwards < 0.
        pub row_slope: f32,
        /// Row coordinate of the optical axis.
        pub middle_row: f32,
        /// Number of rows that see the bars of masks under one angle.
        pub alike_rows: f32,
        /// Not every part of the spot has the shares of rows that cells hold.
        pub rows_apart: u32,
        /// Rows of the band.
        pub row_count: u32,
        /// First row of the band.
        pub first_row: i32,
        /// Pixels.
        pub column_count: u32,
        /// Distance from the source.
        pub detector: f32,
        /// Distance of the rotation centre from the source.
        pub rotation_distance: f32,
        /// M, on the detector.
        pub column_pitch: f32,
        /// Share of the spectrum.
        pub spectral_weight: f32,
    }

    /// A pixel of the random scheme.
    pub struct Pixel in Pixels(readonly) {
        pub column: i32,
        pub row: i32,
        /// Index into the columns.
        pub table: u32,
    }

    /// Push constants of `illuminate.comp`.
    pub struct IlluminatePush {
        pub light_ref: u64 => IlluminationParamsRef,
        pub parts: u64 => CellRowParts,
        pub cell_rows: u64 => CellRows,
        pub cells: u64 => Cells,
        /// `[step][row][column][2]`, light that is the same at all steps behind the last.
        pub sums: u64 => Words,
        /// Number of parts of this dispatch.
        pub part_count: u32,
        /// Index of the first part.
        pub first_part: u32,
        pub first_step: u32,
        /// One behind.
        pub last_step: u32,
        /// Steps of an invocation.
        pub steps_each: u32,
        /// Steps of the scan.
        pub steps: u32,
    }

    /// Push constants of `random_rays.comp`.
    pub struct RandomRaysPush {
        pub light_ref: u64 => IlluminationParamsRef,
        pub pixels: u64 => Pixels,
        /// `[pixel][ray of the batch]`.
        pub rays: u64 => RaysOut,
        pub seed: [u32; 2] => uvec2,
        /// Along x and z; 0 in z: the number of x in all, spread along z.
        pub rays_per_pixel: [u32; 2] => uvec2,
        pub first_ray: u32,
        /// Rays per pixel in this batch.
        pub batch: u32,
        pub pixel_count: u32,
        pub pose: u32,
    }

    /// Push constants of `random_light.comp`.
    pub struct RandomLightPush {
        pub light_ref: u64 => IlluminationParamsRef,
        pub pixels: u64 => Pixels,
        /// `[pixel][ray of the batch]`, unless `empty`.
        pub results: u64 => RayResults,
        pub sums: u64 => Words,
        pub seed: [u32; 2] => uvec2,
        pub rays_per_pixel: [u32; 2] => uvec2,
        pub first_ray: u32,
        pub batch: u32,
        pub pixel_count: u32,
        pub pose: u32,
        /// No sample: every result is zero.
        pub empty: u32,
        /// Invocations that share the rays of a pixel in this batch.
        pub shares: u32,
        pub first_step: u32,
        /// Steps of the scan.
        pub steps: u32,
    }
}
