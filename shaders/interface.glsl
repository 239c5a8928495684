// Every struct and buffer shared with the host (engine/gpu/interface.rs), in scalar layout.
// tests/interface.rs compares names, offsets and sizes with the compiled SPIR-V.
// Lengths in metres in the beam frame of a view unless said otherwise.

// A straight line through (x, z) in the plane y = 0 of the beam frame.
struct Ray {
    float x;
    float z;
    float slope_x; // dx/dy
    float slope_z; // dz/dy
    uint view;
};

// Rotation of the beam frame against the world, and planes of constant y in the beam frame.
struct View {
    float cos_angle;
    float sin_angle;
    float start;    // plane before the sample, where ray queries start
    float analyser; // plane where displacements are taken
};

// A leaf of the BVH: a triangle, counter-clockwise seen from outside, world coordinates.
struct Leaf {
    vec3 a;
    vec3 b;
    vec3 c;
    vec3 normal;  // unit, outward, computed in f64: edges of f32 vertices lose digits
    uint surface; // kind << 28 | index into the surfaces; kind 0 is a triangle
};

// What lies on the two sides of a connected surface.
struct Surface {
    uint object;
    uint inside;   // material
    uint outside;  // material
    uint hash;     // of the object
    float grazing; // cosine of incidence below which the first order is not enough
};

// Optical constants of a material at one energy node.
struct Constants {
    float mu;    // 1/m
    float delta;
};

// Compressed wide BVH node, 80 bytes (Ylitie et al. 2017, obvhs layout).
struct Node {
    vec3 origin;
    uint exponents; // three bytes, then the mask of inner children
    uint child_base;
    uint leaf_base;
    uint meta[2];
    uint min_x[2];
    uint max_x[2];
    uint min_y[2];
    uint max_y[2];
    uint min_z[2];
    uint max_z[2];
};

// Optical depth and deflection of a ray at one energy.
struct Law {
    float optical_depth;
    float displacement_x; // at the analyser
    float displacement_z;
    float slope_x; // change of slope
    float slope_z;
    uint signature;
    uint flags;
    uint crossings;
};

// A crossing of a straight ray, on its list.
struct Crossing {
    float y;
    uint facet; // leaf, and FACET_*
};
#define FACET_ENTERED 0x80000000u // the ray goes into the object
#define FACET_MISSED 0x40000000u  // the bent ray does not cross here
#define FACET_LEAF 0x3fffffffu

// A crossing of a ray, as the host reads it.
struct MetSurface {
    float y;       // beam frame, m
    uint object;
    uint entering; // 1 where the ray goes into the object, 0 where it leaves it
    vec3 normal;   // unit, outward, beam frame
};

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Rays { Ray at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer RaysOut { Ray at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Views { View at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Leaves { Leaf at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Nodes { Node at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Surfaces { Surface at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer ConstantsTable { Constants at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer ObjectMaterials { uint at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Neighbours { uint at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Crossings { Crossing at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words { uint at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Floats { float at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Laws { Law at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer MetSurfaces { MetSurface at[]; };

// The sample on the device.
struct Sample {
    Nodes nodes;
    Leaves leaves;
    Surfaces surfaces;
    ConstantsTable constants; // [material]
    ObjectMaterials object_materials;
    uvec2 acceleration; // address of the top-level acceleration structure
    Views views;
    Neighbours neighbours; // [leaf][edge opposite to a, b, c]: leaf, NO_LEAF at an open edge
};
#define NO_LEAF 0xffffffffu
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer SampleRef { Sample at[]; };

// Moments of a ray, version 1: the head (signature: order-free hash of crossing counts per
// object; balance: +- hash per crossing, 0 where every object was left as often as entered;
// flags; crossings), then per material path length, lever sums x and z, slope sums x and z.
#define MOMENTS_HEAD 4
#define MOMENTS_PER_MATERIAL 5
// With more materials sums of rays are kept in memory even where nobody asks for moments.
#define MATERIALS_IN_REGISTERS 4

// Counters of a run.
#define TALLY_UNBALANCED 0u
#define TALLY_DROPPED 1u
#define TALLY_REFLECTED 2u
#define TALLY_NOT_FINITE 3u
#define TALLY_UNORDERED 4u // not followed in order: the first order counts

#define FLAG_GRAZING 1u    // the first order is not enough at some surface
#define FLAG_EXACT 2u      // traced in order
#define FLAG_REFLECTED 4u  // totally reflected at least once
#define FLAG_UNBALANCED 8u // entered and left some object unequally often
#define FLAG_DROPPED 16u   // a limit was met
#define FLAG_NOT_FINITE 32u
// The highest byte of the flags: least cosine of incidence at a surface over that below which
// the first order is not enough, in 255ths; 255 is 1 or more.
#define FLAG_SHARE_SHIFT 24u

// ---- light -------------------------------------------------------------------------------

// An open interval of a mask, relative to the centre of its period, in the plane where the
// mask is evaluated (the cell plane or the analyser).
struct Aperture {
    float low;
    float high;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Apertures { Aperture at[]; };

struct Mask {
    Apertures apertures; // of one period, sorted
    uint count;
    uint present;
    float period;
    float thickness;    // times the magnification from the mask to the plane of evaluation
    float attenuation;  // mu * thickness; 0 for a sheet
    float transmission; // of a sheet's bars
    uint averaged;      // over energies: bars are opaque, and each cell says how much they shade
    float softness;     // variance of the edges of an averaged mask, in squared shadow widths
    float first;        // low end of the first aperture
    float last;         // high end of the last aperture
};

// What depends on the beamlet (index k of the cell lattice) alone.
struct Column {
    int pixel;             // where its centre lands without deflection
    float pixel_offset;    // landing point less the pixel's centre, on the analyser, m
    float aperture_offset; // landing point less the centre of the nearest detector-mask period
    float sample_offset;   // cell-lattice centre less the nearest sample-mask period's, m
    float slope;           // dx/dy of its centre ray
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Columns { Column at[]; };

// Cells of one beamlet in one interval of z.
struct Strip {
    uint first;
    uint count;
    uint column;
    int row;
    float top;    // within the row, 0..1 downwards
    float bottom;
    uint rows;    // as many rows are alike from this one on
    float light;  // that its cells let through, as a length of the open beam, m
    // Of all its cells:
    float low_landing; // least displacement at the analyser, against the edges of pixels, m
    float high_landing;
    float spread; // largest variance of the displacement, m2, and of the light of narrow cells
    float bend;   // largest change of the displacement per metre, narrow cells apart
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Strips { Strip at[]; };

// A cell: x interval in the cell plane, relative to the beamlet's centre; laws at its ends.
struct Cell {
    float x_low;
    float x_high;
    float depth_low;
    float depth_high;
    float displacement_low; // at the analyser
    float displacement_high;
    float displacement_z;   // at the detector, mean
    float above;            // share that lands in the row above; -1: farther, to be computed
    float below;            // share that lands in the row below
    float pixel_shift;      // of pixel edges on the analyser, from the gap to the detector
    float spread;           // variance of the displacement over energies, m2
    float sample_shade;     // share of the shadow width that narrows apertures, of averaged masks
    float detector_shade;
    float sample_lean;      // covariance over energies of that share and the displacement, m
    float detector_lean;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Cells { Cell at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Offsets { float at[]; };

// A Gaussian of the focal spot.
struct SpotPart {
    float below; // share of the light in this part and those before it; more than 1 in the last
    float x;     // offset from the optical axis, m
    float z;
    float deviation_x; // m
    float deviation_z;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer SpotParts { SpotPart at[]; };

// For cells: of one part of the focal spot. What lies at an offset moves against the rays from
// the source centre, which is where cells stand (docs/physics.md, "Focal spot").
struct Light {
    Mask sample_mask;
    Mask detector_mask;
    Columns columns;
    Offsets offsets;      // of the sample mask, per step, m
    SpotParts spot_parts; // for random draws
    float magnification;  // cell plane to analyser
    float mask_move;      // of a place in the sample against the sample mask, m
    float landing_move;   // of the detector mask's edges against the light of a cell, m
    float pixel_move;     // the same of pixel edges, seen on the analyser
    float slope_move;     // of rays, downwards
    float row_move;       // of light, rows downwards
    float spot;           // blur on the analyser of what lies at the rotation centre, m, std
    float pixel_spot;     // the same at edges of pixels, seen on the analyser
    float shift;          // std of x at the sample mask for a fixed place in the sample, m
    float cell_plane;     // distance from the source
    float analyser;       // distance from the source
    float ratio;          // analyser / detector distance
    float pixel;          // pitch on the analyser
    float weight;         // intensity per metre of the cell plane
    float row_blur;       // rows, standard deviation
    float row_pitch;      // m, on the detector
    float row_slope;      // slope dz/dy per row, downwards < 0
    float middle_row;     // row coordinate of the optical axis
    float alike_rows;     // as many rows see the bars of masks under one angle
    uint row_count;       // rows of the band
    int first_row;        // of the band
    uint column_count;    // pixels
    float detector;       // distance from the source
    float rotation;       // distance of the rotation centre from the source
    float column_pitch;   // m, on the detector
    float part;           // of the spectrum that this light is
};
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer LightRef { Light at[]; };

// A pixel of the random scheme.
struct Pixel {
    int column;
    int row;
    uint table; // index into the columns
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Pixels { Pixel at[]; };

// A mask step of a fit, in half widths of the scan from its centre.
struct Step {
    float offset;
    float offset_low; // what the f32 above leaves of the f64
    float width;      // share of the scan that the step stands for
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Steps { Step at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Curves { float at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer Fits { float at[]; };
