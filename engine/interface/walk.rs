//! What walks read and write. Lengths in metres in the beam frame of a pose unless said otherwise.

shared_structs! {
    /// Structs of the walks.
    pub(super) LAYOUTS;

    /// A straight line through (x, z) in the plane y = 0 of the beam frame.
    pub struct Ray in Rays(readonly), RaysOut {
        pub x: f32,
        pub z: f32,
        /// dx/dy.
        pub slope_x: f32,
        /// dz/dy.
        pub slope_z: f32,
        /// Index of the pose among the poses of all views.
        pub pose: u32,
        /// Key of the normals that the ray draws at rough surfaces; 0: it draws them where it is traced
        /// exactly alone.
        pub key: u32,
    }

    /// Motion of the sample in a pose, and planes of constant y in the beam frame. Rows of the rotation
    /// from the world to the beam frame, then a translation: in f32, and its remainder.
    pub struct PoseTransform in Poses(readonly) {
        /// First row of the rotation; in a turn about z the cosine and sine of its angle, and 0.
        pub x: [f32; 3],
        pub y: [f32; 3],
        pub z: [f32; 3],
        pub x_rest: [f32; 3],
        pub y_rest: [f32; 3],
        pub z_rest: [f32; 3],
        pub position: [f32; 3],
        pub position_rest: [f32; 3],
        /// Plane before the sample, where ray queries start.
        pub start: f32,
        /// Plane where displacements are taken.
        pub analyser: f32,
    }

    /// A leaf of the BVH: a triangle, counter-clockwise seen from outside, world coordinates.
    pub struct Leaf in Leaves(readonly) {
        pub a: [f32; 3],
        pub b: [f32; 3],
        pub c: [f32; 3],
        /// Unit, outward, computed in f64: edges of f32 vertices lose digits.
        pub normal: [f32; 3],
        /// kind << 28 | index; kind 0 is a triangle with the index of its surface. For a triangle of a
        /// prototype in its own frame it is added to the index of its place.
        pub surface: u32,
    }

    /// A prototype in its place.
    pub struct Placed in PlacedRef(readonly) {
        /// In f32, and its remainder.
        pub position: [f32; 3],
        pub rest: [f32; 3],
        /// Quaternion of any length, own frame to world.
        pub rotation: [f32; 4],
        /// Along x and y.
        pub scale: f32,
        pub scale_z: f32,
        pub prototype: u32,
        /// Number of its first primitive.
        pub primitive: u32,
        /// Index of its first surface.
        pub surface: u32,
        /// First word of the list of the shapes that cross it; `NO_PARTNERS` where none does.
        pub partners: u32,
    }

    /// A surface with several places, or an analytic one.
    pub struct Prototype in Prototypes(readonly) {
        /// Node; of an analytic surface its index among the shapes.
        pub root: u32,
        /// First of its leaves, and how many there are; none of an analytic surface.
        pub leaf_base: u32,
        pub leaves: u32,
        /// Number of the first primitive of the first of its places.
        pub primitive: u32,
        /// The first of its places.
        pub placed: u32,
    }

    /// A shape with curved surfaces, centred, along z of its own frame. Parameters: of a frustum the
    /// radius at z = 0, m, half the height, m, and the change of radius per length of z; of an ellipsoid
    /// one over its semi-axes, 1/m; of a tube its outer radius, half its height and its inner radius, m.
    pub struct AnalyticShape in AnalyticShapes(readonly) {
        /// `SHAPE_`.
        pub kind: u32,
        pub parameters: [f32; 3],
    }

    /// A connected surface, with the materials on its two sides.
    pub struct Surface in Surfaces(readonly) {
        pub object: u32,
        /// Material.
        pub inside: u32,
        /// Material.
        pub outside: u32,
        /// Hash of the object.
        pub hash: u32,
        /// Cosine of incidence below which the first order is not enough.
        pub grazing: f32,
        /// Standard deviation of its slopes.
        pub roughness: f32,
        /// Correlation length of its heights, m; 0 where it has slopes alone.
        pub correlation: f32,
        /// Interpolated normals of corners refract light, not the normals of facets.
        pub smooth_: u32,
    }

    /// Optical constants of a material at one energy node.
    pub struct Constants in ConstantsTable(readonly) {
        /// 1/m.
        pub mu: f32,
        pub delta: f32,
        /// Variance of the refraction angle per path length, rad2/m.
        pub scattering: f32,
    }

    /// Directions of the scattering of a material: shares of its variance.
    pub struct ScatteringAxis in ScatteringAxes(readonly) {
        /// Unit vector in world coordinates.
        pub direction: [f32; 3],
        /// Across it.
        pub across: f32,
        /// Along it less across it.
        pub excess: f32,
    }

    /// Compressed wide BVH node, 80 bytes (Ylitie et al. 2017, obvhs layout).
    pub struct Node in Nodes(readonly) {
        pub origin: [f32; 3],
        /// Three bytes, then the mask of inner children.
        pub exponents: u32,
        pub child_base: u32,
        pub leaf_base: u32,
        pub meta: [u32; 2],
        pub min_x: [u32; 2],
        pub max_x: [u32; 2],
        pub min_y: [u32; 2],
        pub max_y: [u32; 2],
        pub min_z: [u32; 2],
        pub max_z: [u32; 2],
    }

    /// Optical depth and deflection of a ray at one energy.
    pub struct RayResult in RayResults {
        pub optical_depth: f32,
        /// At the analyser.
        pub displacement_x: f32,
        pub displacement_z: f32,
        /// Change of slope.
        pub slope_x: f32,
        pub slope_z: f32,
        pub signature: u32,
        pub flags: u32,
        pub crossings: u32,
        /// Variance of the displacement along x by rough surfaces whose normals are not drawn and by materials that
        /// scatter, m2.
        pub displacement_variance: f32,
        /// Variance of the displacement along z and its covariance with that along x, m2, of traced rays.
        pub variance_z: f32,
        pub covariance: f32,
    }

    /// A crossing of a straight ray, on its list.
    pub struct Crossing in Crossings {
        pub y: f32,
        /// Leaf, and `FACET_` bits.
        pub facet: u32,
        /// Index of its surface.
        pub surface: u32,
    }

    /// A crossing of a ray with a surface of the sample.
    pub struct SurfaceCrossing in SurfaceCrossings(writeonly) {
        /// Along the optical axis in the beam frame, m.
        pub y: f32,
        /// Index of the object whose surface it is.
        pub object: u32,
        /// 1 where the ray goes into the object, 0 where it leaves it.
        pub entering: u32,
        /// Unit normal, away from the object's material, beam frame.
        pub normal: [f32; 3],
    }

    /// The sample on the device.
    pub struct Sample in SampleRef(readonly) {
        pub nodes: u64 => Nodes,
        pub leaves: u64 => Leaves,
        pub surfaces: u64 => Surfaces,
        /// `[material]`.
        pub constants: u64 => ConstantsTable,
        pub object_materials: u64 => ObjectMaterials,
        /// Address of the top-level acceleration structure.
        pub acceleration: u64,
        pub poses: u64 => Poses,
        /// `[leaf][edge opposite to a, b, c]`: leaf of the same tree, counted from its first; `NO_LEAF` at
        /// an open edge.
        pub neighbours: u64 => Neighbours,
        pub placed: u64 => PlacedRef,
        pub prototypes: u64 => Prototypes,
        pub shapes: u64 => AnalyticShapes,
        /// Lists of the shapes that cross a shape: `PARTNERS_HEAD` words, then `PARTNER_WORDS` for each.
        pub partners: u64 => Partners,
        /// `[leaf][corner][3]`, unit, in the order of leaves; zero where facets refract by their own
        /// normals.
        pub normals: u64 => CornerNormals,
        /// `[material]`, in samples of `KIND_SCATTERING_AXIS`.
        pub axes: u64 => ScatteringAxes,
        pub prototype_count: u32,
        /// Leaves of the sample itself: larger numbers are primitives of placed meshes.
        pub sample_leaves: u32,
        /// Seed of the scene.
        pub seed: [u32; 2] => uvec2,
    }

    /// Push constants of the order-free walk.
    pub struct TracePush {
        pub sample_ref: u64 => SampleRef,
        pub rays: u64 => Rays,
        /// `[ray][MOMENTS_HEAD + materials * MOMENTS_PER_MATERIAL]`.
        pub moments: u64 => Words,
        pub results: u64 => RayResults,
        /// `[queue][QUEUE_HEAD]`.
        pub queues: u64 => Words,
        /// Indices of rays to trace exactly.
        pub exact: u64 => Words,
        /// Indices of rays that are left, or were left.
        pub left: u64 => Words,
        pub tally: u64 => Words,
        /// Number of rays that the host counted.
        pub count: u32,
        pub materials: u32,
        /// `RAYS_`.
        pub rays_are: u32,
        /// Attempts of this walk; a ray that needs more, of `ATTEMPTS`, is left to another.
        pub attempts: u32,
    }

    /// Push constants of `exact.comp`.
    pub struct ExactPush {
        pub sample_ref: u64 => SampleRef,
        pub rays: u64 => Rays,
        pub results: u64 => RayResults,
        /// `[queue][QUEUE_HEAD]`.
        pub queues: u64 => Words,
        /// Indices of rays; not used when `all` is set; ends with one more if `runs`.
        pub indices: u64 => Words,
        /// Indices of rays that are left to another walk.
        pub lost: u64 => Words,
        /// Indices of rays that cross more than a list holds.
        pub longer: u64 => Words,
        /// `[group][capacity][stride]`.
        pub lists: u64 => Crossings,
        /// `[ray]`: constants of its energy; null: constants of the sample.
        pub nodes: u64 => Words,
        pub tally: u64 => Words,
        /// Queue of the rays, or `NO_QUEUE`.
        pub queue: u32,
        /// Number of rays that are in no queue.
        pub count: u32,
        pub all: u32,
        /// Indices are the first of runs of one ray at several energies.
        pub runs: u32,
        /// Queue of rays that cross more than a list holds.
        pub longer_queue: u32,
        /// Attempts of this walk; a ray that needs more, of `ATTEMPTS`, is left to another.
        pub attempts: u32,
        /// Crossings of a list.
        pub capacity: u32,
        /// Rays of a workgroup.
        pub stride: u32,
        /// Number of lists.
        pub room: u32,
    }

    /// Push constants of `crossings.comp`.
    pub struct CrossingsPush {
        pub sample_ref: u64 => SampleRef,
        pub rays: u64 => Rays,
        /// `[ray][capacity]`.
        pub met: u64 => SurfaceCrossings,
        /// `[ray]`.
        pub counts: u64 => Words,
        /// `[group][capacity][stride]`.
        pub lists: u64 => Crossings,
        pub count: u32,
        pub first: u32,
        /// At least 1.
        pub capacity: u32,
        pub stride: u32,
    }
}
