//! Patches and their rectangles, as the device refines them. Lengths in metres.

use super::walk::{Ray, RayResult};

shared_structs! {
    /// Structs of the refinement.
    pub(super) LAYOUTS;

    /// A patch: a beamlet and a row of the detector.
    pub struct RefinedPatch in RefinedPatches(readonly) {
        /// Index of the beamlet.
        pub column: u32,
        pub row: i32,
        /// First of its base rectangles, `[x][z]`.
        pub first: u32,
        /// Base rectangles along x and z.
        pub base: [u32; 2] => uvec2,
        /// Indices of the patches at lower and higher x, above and below; `PATCH_MISSED` where no ray crosses
        /// the sample, `PATCH_UNKNOWN` where none is traced.
        pub low: u32,
        pub high: u32,
        pub above: u32,
        pub below: u32,
        /// Its light counts where all rays miss the sample.
        pub is_lit: u32,
        /// First of its walls, and their number.
        pub first_wall: u32,
        pub walls: u32,
    }

    /// A facet that rays may miss.
    pub struct RefinedWall in RefinedWalls(readonly) {
        /// Ends of its longest side, from the middle of the beamlet and the upper end of the row.
        pub from_x: f32,
        pub from_z: f32,
        pub to_x: f32,
        pub to_z: f32,
        /// Across that side, m.
        pub width: f32,
        /// Light that it bends out of the light beside it, m times rows.
        pub light: f32,
    }

    /// A beamlet of the lattice. Slopes and places are sums of two numbers.
    pub struct RefinedColumn in RefinedColumns(readonly) {
        /// dx/dy of its centre ray.
        pub slope: f32,
        pub slope_rest: f32,
        /// Its centre ray in the plane of the rotation centre.
        pub x: f32,
        pub x_rest: f32,
        /// Where its centre lands without deflection, from the nearest window of the first kind, and of the
        /// second.
        pub landing: [f32; 2] => vec2,
        /// Its centre, from the nearest period of the sample mask.
        pub mask_offset: f32,
        /// Reduction of each side of an opening by thick bars.
        pub shadow: f32,
    }

    /// A row of the detector, at its upper end.
    pub struct RefinedRow in RefinedRows(readonly) {
        /// dz/dy.
        pub slope: f32,
        pub slope_rest: f32,
        pub z: f32,
        pub z_rest: f32,
        /// Its place in a period along z of the sample mask and of the detector mask, rows, where apertures end along z.
        pub lit_place: f32,
        pub landing_place: f32,
    }

    /// Apertures that end along z, in rows as seen from the source.
    pub struct RefinedHeights in RefinedHeightsRef(readonly) {
        /// Upper end of an aperture of the sample mask in a period, at each different step along z.
        pub tops: u64 => Floats,
        /// Edges of the detector mask along z in a period, ascending.
        pub edges: u64 => Floats,
        /// Numbers of the two; 0 where no aperture of the mask ends along z.
        pub top_count: u32,
        pub edge_count: u32,
        /// Period of the sample mask, and height of an aperture with its blur.
        pub period: f32,
        pub height: f32,
        /// Period of the detector mask.
        pub edge_period: f32,
        /// Padding.
        pub unused: u32,
    }

    /// An interval of x in the cell plane that a mask step opens, from the nearest period.
    pub struct MaskOpening in MaskOpenings(readonly) {
        pub step: u32,
        pub low: f32,
        pub high: f32,
        /// Length after which it repeats, m.
        pub period: f32,
    }

    /// Windows of one kind on the analyser, one to a period.
    pub struct WindowTable in WindowTables(readonly) {
        /// Address of `Floats`: integral of a blurred window over the landing point; of a sharp one the ends
        /// of its parts.
        pub values: u64,
        /// Numbers in the table.
        pub count: u32,
        /// The numbers are ends.
        pub is_sharp: u32,
        pub period: f32,
        /// Share of the light that they pass where they are open.
        pub share: f32,
    }

    /// A rectangle of a patch, with the result of the ray through its centre; split where it has parts.
    pub struct Rectangle in Rectangles {
        /// From the middle of the beamlet, in the cell plane.
        pub x_low: f32,
        pub x_high: f32,
        /// Share of the row, downwards.
        pub z_low: f32,
        pub z_high: f32,
        pub optical_depth: f32,
        /// At the analyser.
        pub displacement: f32,
        /// On the detector, along z.
        pub landing: f32,
        /// Shift of pixel edges on the analyser, from the gap to the detector.
        pub pixel_shift: f32,
        /// Variance of the displacement by rough surfaces, m2.
        pub variance: f32,
        pub signature: u32,
        /// `FLAG_` bits, `RECTANGLE_ALONG_X`, and the number of crossings from bit `RECTANGLE_CROSSINGS` on.
        pub flags: u32,
        pub patch_index: u32,
        /// First of its three parts; 0: it has none.
        pub parts: u32,
        /// The rectangle that it is a part of; its own index for a base rectangle.
        pub whole: u32,
        /// Largest changes of light towards neighbours along x and z.
        pub change_x: f32,
        pub change_z: f32,
        /// Errors of its light and of the displacement, squared, shares of the budgets squared.
        pub light_error: f32,
        pub turn_error: f32,
        /// Square of the largest share of it that a step lets through; 0 where it is too small to be split.
        pub weight: f32,
    }

    /// A rectangle whose ray is to be traced exactly at each energy.
    pub struct RepeatedRectangle in RepeatedRectangles(writeonly) {
        /// Its ray.
        pub x: f32,
        pub z: f32,
        pub slope_x: f32,
        pub slope_z: f32,
        pub x_low: f32,
        pub x_high: f32,
        pub z_low: f32,
        pub z_high: f32,
        /// Index of the beamlet.
        pub column: u32,
        pub row: i32,
        /// Variance of its displacement by rough surfaces at the constants of the rays, m2; taken to grow with the
        /// square of the strength of refraction at other energies.
        pub variance: f32,
    }

    /// A rectangle that is not split, as the host makes a cell of it.
    pub struct RefinedLeaf in RefinedLeaves(writeonly) {
        pub x_low: f32,
        pub x_high: f32,
        pub z_low: f32,
        pub z_high: f32,
        /// Place of its ray: from the middle of the beamlet, and share of the row.
        pub at: [f32; 2] => vec2,
        pub ray: Ray,
        pub result: RayResult,
        /// Slopes along x: of the optical depth, 1/m, and of the displacement.
        pub depth_slope: f32,
        pub displacement_slope: f32,
        /// Light over its height behind apertures that end along z, else 0: growth of the landing, rows, and change
        /// relative to the mean.
        pub growth: f32,
        pub tilt: f32,
        /// Index of the beamlet.
        pub column: u32,
        pub row: i32,
        /// Padding.
        pub unused: u32,
    }

    /// Energies of a spectrum, and the materials at them.
    pub struct RefinedSpectrum in RefinedSpectrumRef {
        /// Moments of the rays of a batch, `[ray][stride]`.
        pub traced: u64 => Floats,
        /// `[rectangle]`, of that which a ray was traced for: `[material][KEPT_WORDS]`, then `[pair]`.
        pub kept: u64 => Floats,
        /// Number of each material in `traced`.
        pub materials: u64 => Words,
        /// Pairs of materials, where surfaces are rough: word of the variance between them in `traced`.
        pub pairs: u64 => Words,
        /// `[node][pair]`: square of the step of delta.
        pub steps: u64 => Floats,
        /// `[node][material][2]`: attenuation, 1/m, and delta; behind the nodes at the constants of the rays.
        pub constants: u64 => Floats,
        /// `[node][2]`: refraction relative to the constants of the rays; share of the grazing incidence below which
        /// total reflection turns light by as much as at the constants of the rays.
        pub ratios: u64 => Floats,
        /// `[block of rows][beamlet][...]`: shares of light by masks (`refine/shares.glsl`).
        pub shares: u64 => Floats,
        /// `[list][near, far]`: number of cell rows; then the number of all, and where each begins.
        pub counts: u64 => Words,
        /// `[cell row][3]`: its list, its place there, and the number of its first cell.
        pub marks: u64 => Words,
        /// `[patch][group][MERGED_COLUMNS][MERGED_WORDS]`: leaked light, as integers.
        pub merged: u64 => Words,
        pub repeated: u64 => RepeatedRectangles,
        pub nodes: u32,
        pub material_count: u32,
        pub pair_count: u32,
        /// Words of the moments of a traced ray.
        pub stride: u32,
        /// Ways through the masks whose energies share cells.
        pub groups: u32,
        /// Number of beamlets.
        pub columns: u32,
        /// Rows of a block.
        pub alike_rows: u32,
        pub first_block: i32,
        /// Width from which on cells are held to the tolerances.
        pub full_width: f32,
        /// Tolerance of mean displacements, m.
        pub tolerance: f32,
        /// Standard deviation of the displacement that energies of a cell may have, m: along x on the analyser.
        pub spread: f32,
        /// Along z on the detector.
        pub spread_z: f32,
        /// Displacement that merged light may have at most, m.
        pub reach: f32,
        /// Rectangles below this share of the grazing incidence are traced exactly at each energy.
        pub repeated_below: f32,
    }

    /// Parameters of the refinement of a group of patches.
    pub struct RefineParams in RefineParamsRef {
        pub patches: u64 => RefinedPatches,
        pub columns: u64 => RefinedColumns,
        pub rows: u64 => RefinedRows,
        pub walls: u64 => RefinedWalls,
        pub openings: u64 => MaskOpenings,
        pub windows: u64 => WindowTables,
        pub rectangles: u64 => Rectangles,
        /// `[patch][REFINED_HEAD + ...]`: sums of errors.
        pub sums: u64 => Words,
        /// Cursors and counts, `HEAD_`.
        pub head: u64 => Words,
        /// Rectangles that may still be split, by turns.
        pub lists: u64 => Words,
        /// Rectangles to split, or patches of two rays that are spread evenly.
        pub splits: u64 => Words,
        /// `[rectangle][3]`: changes that younger neighbours ask to take into account, and whether they do.
        pub asked: u64 => Words,
        /// Rectangles that are asked.
        pub again: u64 => Words,
        pub cells: u64 => CellsMade,
        /// `[item][3]`: a rectangle of a run, its first cell, and how far its cells of other lists are apart.
        pub made: u64 => Words,
        /// `[run][2]`: its first item, and their number.
        pub runs: u64 => Words,
        pub cell_rows: u64 => CellRowsOut,
        /// Near parts from the first on, far parts from `cell_room` on.
        pub parts: u64 => CellRowPartsOut,
        pub rays: u64 => RaysOut,
        pub results: u64 => RayResults,
        /// `[queue][QUEUE_HEAD]`.
        pub queues: u64 => Words,
        /// Reported errors and counts, `REPORT_`.
        pub report: u64 => Words,
        /// Where the device makes cells of a spectrum, else 0.
        pub spectrum: u64 => RefinedSpectrumRef,
        /// Optical depth of the light of all energies over the depth at the constants of the rays
        /// (`refine/hardening.glsl`); 0 at one energy.
        pub hardening: u64 => Floats,
        /// Where the host makes the cells, else 0: `[rectangle]`, results of its rays, and leaves of a submission.
        pub all_results: u64 => RayResults,
        pub leaves: u64 => RefinedLeaves,
        /// 0 behind slits.
        pub heights: u64 => RefinedHeightsRef,
        /// Number of patches to refine, and of these with the neighbours that have base rays alone.
        pub patch_count: u32,
        pub all_patches: u32,
        /// Base rectangles of these patches, and of all.
        pub own_base: u32,
        pub all_base: u32,
        /// Rectangles that there is room for.
        pub room: u32,
        /// Cells that there is room for.
        pub cell_room: u32,
        /// Rays of a batch, and of a workgroup of the walk.
        pub batch: u32,
        pub rays_of_group: u32,
        pub queue_count: u32,
        pub opening_count: u32,
        /// Mask steps.
        pub steps: u32,
        pub window_count: u32,
        pub pose: u32,
        pub max_rays: u32,
        pub first_row: i32,
        /// Rows of the detector that are recorded, and rows of the present band.
        pub recorded: [i32; 2] => ivec2,
        pub wanted: [i32; 2] => ivec2,
        /// Rows that light is followed over.
        pub halo: f32,
        /// Period of the beamlets in the cell plane.
        pub period: f32,
        /// Cell plane to source, inverse, 1/m; source to rotation centre.
        pub inverse_plane: f32,
        pub rotation: f32,
        /// dz/dy per row.
        pub row_slope: f32,
        /// Cell plane to analyser.
        pub magnification: f32,
        /// Source to analyser, and half the width of the detector there with all that blurs.
        pub analyser: f32,
        pub half_width: f32,
        /// Analyser to detector, and analyser over detector distance.
        pub gap: f32,
        pub ratio: f32,
        pub row_pitch: f32,
        /// A row in the cell plane.
        pub row_height: f32,
        /// Standard deviation of the blur over rows, rows.
        pub row_blur: f32,
        /// Recorded value per metre of open cell plane.
        pub weight: f32,
        /// Share of the light that the bars of the sample mask let through.
        pub leak: f32,
        /// Largest change of the share of light that passes a window, per displacement, 1/m.
        pub steepest: f32,
        /// Error of the light, share of open beam, and of the displacement that a patch may have.
        pub light_budget: f32,
        pub displacement_budget: f32,
        /// Shares of parts of the light of a spectrum, and refraction of each over that at the constants of the rays,
        /// the largest first and the least last.
        pub part_shares: [f32; 4],
        pub part_ratios: [f32; 4],
        /// Width that a mask step opens, of a beamlet.
        pub open_width: f32,
        /// Least width and height of a rectangle that is split.
        pub least: [f32; 2] => vec2,
        /// Steps of f32 coordinates beside a rectangle.
        pub beside: [f32; 2] => vec2,
        /// Error of a reported value over `light_budget`, 1e-9 of open beam.
        pub reported: f32,
        /// A reported error beyond this is beyond the tolerance, 1e-9 of open beam.
        pub tolerance: u32,
    }

    /// Push constants of the kernels of the refinement.
    pub struct RefinePush {
        pub params: u64 => RefineParamsRef,
        /// `STAGE_` that `refine/plan.comp` plans.
        pub stage: u32,
        pub unused: u32,
    }
}
