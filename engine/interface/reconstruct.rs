//! What back-projection reads.

shared_structs! {
    /// Structs of reconstruction.
    pub(super) LAYOUTS;

    /// Cosine and sine of the angle of a view.
    pub struct ViewTurn in ViewTurns(readonly) {
        pub cosine: f32,
        pub sine: f32,
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
        /// Columns and rows by a length at the axis, and those of the optical axis.
        pub column_scale: f32,
        pub column_zero: f32,
        pub row_scale: f32,
        pub row_zero: f32,
    }
}
