//! What projections and back-projections read.

shared_structs! {
    /// Structs of reconstruction.
    pub(super) LAYOUTS;

    /// Cosine and sine of the angle of a view.
    pub struct ViewTurn in ViewTurns(readonly) {
        pub cosine: f32,
        pub sine: f32,
    }

    /// Rays of neighbouring columns of a view that cross the volume along the same axis. A slice is
    /// counted from the middle one, a place on the detector in mean distances of columns from its middle,
    /// voxels of a slice from the middle of it. A parameter of a ray in a slice is a sum `value +
    /// by_slice * slice + by_place * place + by_both * slice * place`, over the same sum of `weight`.
    pub struct Sheet in Sheets(readonly) {
        /// Voxels at which a ray crosses the slice.
        pub cross: f32,
        pub cross_by_slice: f32,
        pub cross_by_place: f32,
        pub cross_by_both: f32,
        pub weight: f32,
        pub weight_by_place: f32,
        /// Distance from the source along the optical axis, over the distance of the axis of rotation.
        pub scale: f32,
        pub scale_by_slice: f32,
        /// Depth behind the axis of rotation, m.
        pub depth: f32,
        pub depth_by_slice: f32,
        pub depth_by_place: f32,
        /// Columns of the sheet: from `begin`, before `end`.
        pub begin: u32,
        pub end: u32,
        /// Slices lie across x, not across y.
        pub is_x: u32,
    }

    /// Rays of a view with a motion of its own, in slices across one axis of the volume. A slice is
    /// counted from the middle one, voxels from the middle of a slice; a ray is (1, place, row): its place
    /// in mean distances of columns, its row, both from the middle of the detector. Values are scalar
    /// products with a ray, over that with `weight`.
    pub struct MovedSheet in MovedSheets(readonly) {
        /// Voxels at which a ray crosses slice 0, along the first of the other axes, and the change from
        /// slice to slice.
        pub first: [f32; 3],
        pub first_by_slice: [f32; 3],
        /// The same along the second.
        pub second: [f32; 3],
        pub second_by_slice: [f32; 3],
        /// Slices per depth: rays belong to the axis with the largest.
        pub weight: [f32; 3],
        /// Depth behind the rotation centre, m.
        pub depth: [f32; 3],
        pub depth_by_slice: f32,
        /// Some rays of the view may belong to this axis.
        pub is_used: u32,
    }

    /// Place, row and 1 + depth over the distance of the source of a voxel in a view: scalar products with
    /// (x, y, z, 1), in voxels from the middle of the volume. Place and row are over the last.
    pub struct MovedView in MovedViews(readonly) {
        pub place: [f32; 4],
        pub row: [f32; 4],
        pub scale: [f32; 4],
    }

    /// Push constants of `reconstruct/project_moved.comp`.
    pub struct ProjectMovedPush {
        /// Three of each view.
        pub sheets: u64 => MovedSheets,
        /// Place of each column.
        pub places: u64 => Projections,
        /// `[z][y][x]` of a slab.
        pub volume: u64 => Projections,
        /// `[view][row][column]`, added to.
        pub rays: u64 => Floats,
        pub columns: u32,
        pub rows: u32,
        pub size_x: u32,
        pub size_y: u32,
        pub size_z: u32,
        /// Planes of the volume in the slab.
        pub first_plane: u32,
        pub plane_end: u32,
        /// Rays of this dispatch: from `first`, before `end`.
        pub first: u32,
        pub end: u32,
        /// `ARM_`
        pub arm: u32,
        /// One over the lever arm of the rotation centre, 1/m.
        pub per_lever: f32,
        /// Taken off the factor of the arm.
        pub arm_less: f32,
        /// One over the distance from the source to the rotation centre, 1/m; 0 in a parallel beam.
        pub per_distance: f32,
    }

    /// Push constants of `reconstruct/project_back_moved.comp`.
    pub struct ProjectBackMovedPush {
        pub sheets: u64 => MovedSheets,
        pub views: u64 => MovedViews,
        pub places: u64 => Projections,
        /// Per place in mean distances from the first column: the first column from there on.
        pub starts: u64 => Words,
        /// `[z][y][x]` of a slab, added to.
        pub volume: u64 => Floats,
        /// `[view][row][column]`.
        pub rays: u64 => Projections,
        pub view_count: u32,
        pub columns: u32,
        pub rows: u32,
        pub size_x: u32,
        pub size_y: u32,
        pub size_z: u32,
        pub first_plane: u32,
        /// Voxels of this dispatch: from `first`, before `end`.
        pub first: u32,
        pub end: u32,
        pub arm: u32,
        pub per_lever: f32,
        pub arm_less: f32,
        pub per_distance: f32,
    }

    /// Push constants of `reconstruct/project.comp`.
    pub struct ProjectPush {
        /// Two of each view.
        pub sheets: u64 => Sheets,
        /// Place of each column.
        pub places: u64 => Projections,
        /// `[z][y][x]` of a slab.
        pub volume: u64 => Projections,
        /// `[view][row][column]`, added to.
        pub rays: u64 => Floats,
        pub columns: u32,
        pub rows: u32,
        pub size_x: u32,
        pub size_y: u32,
        /// Planes of the volume in the slab.
        pub first_plane: u32,
        pub plane_end: u32,
        /// Rays of this dispatch: from `first`, before `end`.
        pub first: u32,
        pub end: u32,
        /// `ARM_`
        pub arm: u32,
        /// One over the lever arm of the axis of rotation, 1/m.
        pub per_lever: f32,
        /// Taken off the factor of the arm.
        pub arm_less: f32,
        /// Place of the first row at the axis of rotation, distance of rows, and place of plane 0, in
        /// distances of planes.
        pub row_zero: f32,
        pub row_step: f32,
        pub plane_zero: f32,
    }

    /// Push constants of `reconstruct/project_back.comp`.
    pub struct ProjectBackPush {
        pub sheets: u64 => Sheets,
        pub places: u64 => Projections,
        /// Per place in mean distances from the first column: the first column from there on.
        pub starts: u64 => Words,
        /// `[z][y][x]` of a slab, added to.
        pub volume: u64 => Floats,
        /// `[view][row][column]`.
        pub rays: u64 => Projections,
        pub view_count: u32,
        pub columns: u32,
        pub rows: u32,
        /// Places of columns are whole numbers from the first.
        pub is_even: u32,
        pub size_x: u32,
        pub size_y: u32,
        pub first_plane: u32,
        /// Voxels of this dispatch: from `first`, before `end`.
        pub first: u32,
        pub end: u32,
        pub arm: u32,
        pub per_lever: f32,
        pub arm_less: f32,
        pub row_zero: f32,
        pub row_step: f32,
        pub plane_zero: f32,
    }

    /// Slices per depth along x, y and z that the rays of a view cross, 1/m: `value + by place * place +
    /// by row * row`, place in mean distances of columns and row from the middle of the detector, each
    /// the sum of two f32. The path from slice to slice is one over the largest.
    pub struct StepLaw in StepLaws(readonly) {
        pub high: [f32; 3],
        pub low: [f32; 3],
        pub place_high: [f32; 3],
        pub place_low: [f32; 3],
        pub row_high: [f32; 3],
        pub row_low: [f32; 3],
    }

    /// Factors of the integrals at a column, each the sum of two f32: of that at its place (of its left
    /// border), and of that at the next place.
    pub struct Slopes in RowSlopes(readonly) {
        pub left: f32,
        pub left_low: f32,
        pub right: f32,
        pub right_low: f32,
    }

    /// Sum over a chunk: `(high + low) 2^exponent`.
    pub struct DotSum in DotSums(writeonly) {
        pub high: f32,
        pub low: f32,
        pub exponent: i32,
        /// Largest value of the first vector, at least 0.
        pub most: f32,
    }

    /// Push constants of `reconstruct/combine.comp`.
    pub struct CombinePush {
        pub to: u64 => Floats,
        /// May be the values that are written.
        pub a: u64 => Projections,
        pub b: u64 => Projections,
        pub count: u32,
        /// `COMBINE_`
        pub kind: u32,
        pub factor: f32,
    }

    /// Push constants of `reconstruct/dot.comp`.
    pub struct DotPush {
        pub a: u64 => Projections,
        pub b: u64 => Projections,
        /// Factors of the values of `a`, if `is_weighted`.
        pub weights: u64 => Projections,
        /// One of each chunk.
        pub sums: u64 => DotSums,
        pub count: u32,
        pub is_weighted: u32,
    }

    /// Push constants of `reconstruct/fourier.comp`.
    pub struct FourierPush {
        /// Complex numbers `[pair][high][wide]`, or `[z][y][x]` of a volume.
        pub from: u64 => Floats,
        pub to: u64 => Floats,
        /// Cosine and sine of -2 pi n over their number, a power of two.
        pub roots: u64 => Projections,
        pub log_roots: u32,
        /// Items of this dispatch: numbers, or groups of numbers that are joined.
        pub count: u32,
        /// `FOURIER_`
        pub kind: u32,
        /// Logarithm of the numbers of a line; numbers that are not zero.
        pub log_numbers: u32,
        pub valid: u32,
        /// Logarithm of the distance from a number of a line to the next: 0 for rows.
        pub log_stride: u32,
        /// Logarithm of the numbers whose transforms are joined.
        pub log_joined: u32,
        pub is_inverse: u32,
        /// Numbers are filtered first.
        pub is_filtered: u32,
        /// Logarithms of the sides of a plane.
        pub log_wide: u32,
        pub log_high: u32,
        pub size_x: u32,
        pub size_y: u32,
        /// Voxels of the planes.
        pub voxels: u32,
        /// Least frequency, in numbers of a cycle.
        pub least: f32,
    }

    /// Push constants of `reconstruct/sinogram.comp`.
    pub struct SinogramPush {
        /// One of each view.
        pub laws: u64 => StepLaws,
        /// Two f32 of each place, in mean distances of columns from the middle of the detector.
        pub places: u64 => Projections,
        /// `[row][column]`.
        pub slopes: u64 => RowSlopes,
        /// `[view][row][place]`.
        pub rays: u64 => Floats,
        /// `[view][row][column]`.
        pub values: u64 => Floats,
        /// Factors of the values, if `is_weighted`.
        pub weights: u64 => Projections,
        /// Values to write.
        pub count: u32,
        pub columns: u32,
        pub place_count: u32,
        pub rows: u32,
        /// Values are differences of neighbours.
        pub is_difference: u32,
        pub is_weighted: u32,
    }

    /// Push constants of `reconstruct/back_project.comp`. Lengths in m.
    pub struct BackProjectPush {
        pub views: u64 => ViewTurns,
        /// `[view][row][column]`.
        pub projections: u64 => Projections,
        /// `[z][y][x]` of a slab.
        pub volume: u64 => Floats,
        pub view_count: u32,
        pub columns: u32,
        pub rows: u32,
        pub size_x: u32,
        pub size_y: u32,
        /// Slice of the volume that the slab begins with.
        pub first_slice: u32,
        /// Voxels of the slab in this dispatch: from `first`, before `end`.
        pub first: u32,
        pub end: u32,
        /// Weights fall as the square of the distance from the source.
        pub is_squared: u32,
        /// Centre of voxel (0, 0, 0) from the axis of rotation.
        pub origin: [f32; 3],
        pub voxel: [f32; 3],
        /// Axis of rotation from the optical axis along x.
        pub axis: f32,
        /// One over the distance from source to axis, 0 in a parallel beam.
        pub per_distance: f32,
        /// Columns and rows per length at the axis, and the column and row of the optical axis.
        pub column_scale: f32,
        pub column_zero: f32,
        pub row_scale: f32,
        pub row_zero: f32,
    }
}
