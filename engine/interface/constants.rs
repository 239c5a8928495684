//! Numbers that host and shaders share.

shared_constants! {
    /// Invocations of a workgroup, of every kernel.
    GROUP: u32 = 64;
    /// Most energies of a spectrum.
    MOST_ENERGIES: u32 = 256;
    /// Energies of an invocation of `light/energies.comp`.
    ENERGIES_EACH: u32 = 4;
    /// Mask steps of an invocation of `random_light.comp`.
    RANDOM_STEPS: u32 = 8;

    /// In place of the first ray of a line that misses the sample.
    WAVE_EMPTY: u32 = u32::MAX;

    /// Values of a vector that a workgroup combines.
    CHUNK: u32 = 1 << 12;
    /// Values of two vectors that a workgroup multiplies and sums.
    DOT_CHUNK: u32 = 1 << 14;
    /// Numbers of a step of a Fourier transform that a workgroup makes at a time.
    FOURIER_CHUNK: u32 = 512;
    /// Two planes of a volume become the real and the imaginary part of one.
    FOURIER_PACK: u32 = 0;
    /// The way back.
    FOURIER_UNPACK: u32 = 1;
    /// Joins two transforms.
    FOURIER_PAIRS: u32 = 2;
    /// Joins four transforms.
    FOURIER_FOURS: u32 = 3;
    /// a + factor b.
    COMBINE_SUM: u32 = 0;
    /// a b.
    COMBINE_PRODUCT: u32 = 1;
    /// a where it is above zero, else 0.
    COMBINE_BOUND: u32 = 2;
    /// a where b is above the factor, else 0.
    COMBINE_WHERE: u32 = 3;
    /// One over a where it is above the factor, else 0.
    COMBINE_INVERSE: u32 = 4;

    /// Lanes that hold the words of a record of a bundle, a word each: the least subgroup of
    /// `trace_bundles.comp`. Subgroups of twice the size hold everything twice.
    BUNDLE_LANES: u32 = 8;
    /// Rays of each lane of a bundle.
    RAYS_PER_LANE: u32 = 4;
    /// Levels of the software BVH: entries of the stack of a walk.
    STACK: u32 = 32;
    /// Bits of a leaf's surface word that index the surfaces; the kind is in the bits above.
    SURFACE_INDEX: u32 = (1 << 28) - 1;
    /// Kind of a leaf that is a placed shape with curved surfaces; its index is in the bits below.
    LEAF_SHAPE: u32 = 1 << 28;
    /// Kind of a leaf that is a placed mesh; its index is in the bits below.
    LEAF_MESH: u32 = 2 << 28;
    /// Kind in a sample: placed meshes.
    KIND_MESH: u32 = 1;
    /// Kind in a sample: cylinders and cones.
    KIND_FRUSTUM: u32 = 2;
    /// Kind in a sample: ellipsoids and spheres.
    KIND_ELLIPSOID: u32 = 4;
    /// Kind in a sample: tubes.
    KIND_TUBE: u32 = 8;
    /// Kind in a sample: rough surfaces, placed or not.
    KIND_ROUGH: u32 = 16;
    /// Kind in a sample: surfaces that refract by interpolated normals.
    KIND_SMOOTH: u32 = 32;
    /// Kind in a sample: exact shapes whose surfaces cross.
    KIND_CROSSED: u32 = 64;
    /// Kind in a sample: views that move the sample otherwise than by a turn about z.
    KIND_MOVED: u32 = 128;
    /// Kind in a sample: rough surfaces have heights, not slopes.
    KIND_HEIGHTS: u32 = 256;
    /// Kind in a sample: materials that scatter.
    KIND_SCATTERING: u32 = 512;
    /// Kind in a sample: materials that scatter along an axis by another variance than across it.
    KIND_SCATTERING_AXIS: u32 = 1024;
    /// Cylinder, cone or truncated cone.
    SHAPE_FRUSTUM: u32 = 0;
    /// Ellipsoid or sphere.
    SHAPE_ELLIPSOID: u32 = 1;
    /// Tube.
    SHAPE_TUBE: u32 = 2;
    /// In place of the list of the shapes that cross a shape, where none does.
    NO_PARTNERS: u32 = u32::MAX;
    /// Words of the list of a shape that others cross before its partners: the object around all of
    /// them, counted from 1 (0: the surroundings), and their number.
    PARTNERS_HEAD: u32 = 2;
    /// Words of a partner: its place, and two f32.
    PARTNER_WORDS: u32 = 3;
    /// Word of the radius of the ball around a partner, m.
    PARTNER_BALL: u32 = 1;
    /// Word of the largest radius of a partner around its axis, m.
    PARTNER_ROD: u32 = 2;
    /// In place of a neighbour at an open edge.
    NO_LEAF: u32 = u32::MAX;

    /// Bit of a crossing on a list: the ray enters the object.
    FACET_ENTERED: u32 = 1 << 31;
    /// Bit of a crossing on a list: the bent ray does not cross here.
    FACET_MISSED: u32 = 1 << 30;
    /// Bits of the leaf in a crossing on a list.
    FACET_LEAF: u32 = FACET_MISSED - 1;
    /// Crossings that the longest list of a ray that is traced exactly holds.
    LONGEST_LIST: u32 = 1 << 20;

    /// Attempts to trace a ray, each a little to the side of the one before.
    ATTEMPTS: u32 = 5;
    /// Words at the head of a queue of rays: their number, and the workgroups of a dispatch of one
    /// invocation for each.
    QUEUE_HEAD: u32 = 4;
    /// Queue of rays that a walk leaves to another.
    QUEUE_LEFT: u32 = 0;
    /// Queue of rays to trace exactly.
    QUEUE_EXACT: u32 = 1;
    /// Queue of rays that an exact walk leaves to another.
    QUEUE_LOST: u32 = 2;
    /// First of the queues of rays with more crossings than the lists of a pass hold, one for each pass.
    QUEUE_LONGER: u32 = 3;
    /// In place of a queue, where the host knows the rays.
    NO_QUEUE: u32 = u32::MAX;
    /// Rays of a pass: the first ones, in the number that the host gives.
    RAYS_COUNTED: u32 = 0;
    /// Rays of a pass: rays of `QUEUE_LEFT`.
    RAYS_LEFT: u32 = 1;

    /// Words at the head of a ray's moments.
    MOMENTS_HEAD: usize = 4;
    /// Word of the head: hash of the crossings per object, the same in any order.
    MOMENTS_SIGNATURE: usize = 0;
    /// Word of the head: sum of +- a hash per crossing, 0 where every object was left as often as
    /// entered.
    MOMENTS_BALANCE: usize = 1;
    /// Word of the head: `FLAG_` bits.
    MOMENTS_FLAGS: usize = 2;
    /// Word of the head: crossings.
    MOMENTS_CROSSINGS: usize = 3;
    /// Floats per material behind the head.
    MOMENTS_PER_MATERIAL: usize = 5;
    /// Float of a material: path length, m.
    MOMENTS_PATH: usize = 0;
    /// Floats of a material: lever sums in x and z, m.
    MOMENTS_LEVER: usize = 1;
    /// Floats of a material: slope sums in x and z.
    MOMENTS_SLOPE: usize = 3;
    /// Floats per pair of materials behind these: variance of the slope along x by rough surfaces between
    /// the two, over the square of the step of delta.
    MOMENTS_PER_PAIR: usize = 3;
    /// Floats of a pair: that variance, times the lever, m, and times its square, m2.
    MOMENTS_VARIANCE: usize = 0;
    /// Float of a pair where rough surfaces have heights: path that these add in the material of the larger index
    /// and take from the other, m.
    MOMENTS_HEIGHT: usize = 0;
    /// Distance from which on a blur takes no light over borders of rows and windows, standard deviations: 1e-9 of it goes
    /// farther (`a_whole_row_loses_the_same_share_on_both_sides`, `a_wide_blur_takes_light_to_windows_far_away`).
    NO_LIGHT: f64 = 6.0;
    /// Least cosine of incidence at a smooth normal: one that turns away is moved to the horizon.
    HORIZON: f64 = 1e-4;
    /// Cosine of incidence over the roughness of a surface, below which rays of cells draw its normals.
    ROUGH_GRAZING: f64 = 15.0;
    /// Least cosine of incidence over the roughness of a surface that a height is seen under: nearer to grazing parts
    /// of the surface hide others.
    HEIGHT_COSINE: f64 = 3.0;
    /// Crossings of a ray from which on it is one of many bodies.
    MANY_CROSSINGS: u32 = 16;
    /// Share of the grazing incidence below which rays through many bodies are followed in order.
    MANY_GRAZING: f64 = 0.1;
    /// With more materials sums of rays are kept in memory, even without moments.
    MATERIALS_IN_REGISTERS: u32 = 4;

    /// Counters of a run.
    TALLY_COUNTERS: usize = 7;
    /// Rays that left some object more or less often than they entered it.
    TALLY_UNBALANCED: usize = 0;
    /// Rays that reached a limit.
    TALLY_DROPPED: usize = 1;
    /// Rays that were totally reflected.
    TALLY_REFLECTED: usize = 2;
    /// Rays with a value that is not finite.
    TALLY_NOT_FINITE: usize = 3;
    /// Rays that could not be followed exactly: the first order counts.
    TALLY_UNORDERED: usize = 4;
    /// Rays with a negative path in a material.
    TALLY_NEGATIVE: usize = 5;
    /// Further attempts to trace a ray.
    TALLY_RETRACED: usize = 6;
    /// Length of a negative path that counts, m: sums of paths are rounded to less.
    NEGATIVE_PATH: f64 = 1e-7;

    /// The first order is not enough at some surface.
    FLAG_GRAZING: u32 = 1;
    /// Traced in order.
    FLAG_EXACT: u32 = 2;
    /// Totally reflected at least once.
    FLAG_REFLECTED: u32 = 4;
    /// Entered and left some object unequally often.
    FLAG_UNBALANCED: u32 = 8;
    /// A limit was reached.
    FLAG_DROPPED: u32 = 16;
    /// A value is not finite.
    FLAG_NOT_FINITE: u32 = 32;
    /// Its normal at a rough surface is drawn: another ray there may go elsewhere.
    FLAG_DRAWN: u32 = 64;
    /// The highest byte of a result's flags: least cosine of incidence over that below which the
    /// first order is not enough, in 255ths; 255 is 1 or more.
    FLAG_SHARE_SHIFT: u32 = 24;

    /// Light that one Gaussian leaves out by the skewness of a soft edge.
    EDGE_SKEWNESS: f64 = 0.1;
    /// Light that one Gaussian leaves out by the flatness of a soft edge.
    EDGE_FLATNESS: f64 = 0.035;

    /// Flag of a fit: all values are the same, or none is above another.
    CURVE_DEAD: u32 = 1;
    /// Flag of a fit: a value is not a number or infinite.
    CURVE_NOT_FINITE: u32 = 2;
    /// Flag of a fit: values at or above the saturation were left out.
    CURVE_SATURATED: u32 = 4;
    /// Flag of a fit: fewer values are left than it needs.
    CURVE_FEW: u32 = 8;
    /// Flag of a fit: it did not settle.
    CURVE_NOT_CONVERGED: u32 = 16;
    /// Flag of a fit: the condition number of its normal equations is too large.
    CURVE_ILL_CONDITIONED: u32 = 32;
    /// Flag of a fit: the offsets do not resolve the width.
    CURVE_WIDTH: u32 = 64;
    /// Flag of a fit: the centre lies outside the scan.
    CURVE_OUTSIDE: u32 = 128;
    /// Flag of a fit: the amplitude is not above its uncertainty.
    CURVE_NO_PEAK: u32 = 256;

    /// Values of a fit, a plane of curves each.
    FIT_VALUES: usize = 10;
    /// Amplitude of the Gaussian.
    FIT_AMPLITUDE: usize = 0;
    /// Its centre, half widths of the scan.
    FIT_CENTRE: usize = 1;
    /// Its standard deviation, half widths of the scan.
    FIT_WIDTH: usize = 2;
    /// Background below it.
    FIT_BACKGROUND: usize = 3;
    /// Root mean square of the residuals.
    FIT_RESIDUAL: usize = 4;
    /// Standard uncertainty of the area, share of it.
    FIT_AREA_SIGMA: usize = 5;
    /// Standard uncertainty of the centre, half widths of the scan.
    FIT_CENTRE_SIGMA: usize = 6;
    /// Standard uncertainty of the width, half widths of the scan.
    FIT_WIDTH_SIGMA: usize = 7;
    /// Condition number of the normal equations.
    FIT_CONDITION: usize = 8;
    /// `CURVE_` bits, as a float.
    FIT_FLAGS: usize = 9;

    /// Weights of a projection: all voxels of a ray count alike,
    ARM_NONE: u32 = 0;
    /// by the lever arm, and less the farther they are from the source: derivatives along a row;
    ARM_SLOPE: u32 = 1;
    /// by the square of the lever arm: variances of angles.
    ARM_SQUARED: u32 = 2;
}
