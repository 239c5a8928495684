// Crossings of a line and a shape with curved surfaces. The KINDS in a sample are constants of the
// kernel: CPU devices execute unused code, too.

#include "walk/convex.glsl"

const bool CONVEX = (KINDS & (KIND_FRUSTUM | KIND_ELLIPSOID | KIND_TUBE)) != 0u;

struct ShapeCrossings {
    uint count; // 0, 2 or 4, in order: the first an entry, then by turns
    float y[4]; // beam frame
    vec3 normal_[4]; // unit, outward, beam frame
};

// All crossings of a line that is `moved` by (x, z) at y = 0 and bent by a change of slope.
ShapeCrossings shape_crossings(Beam beam, vec2 moved, vec2 bent, Placed placed) {
    ShapeCrossings all;
    all.count = 0u;
    if (CONVEX) {
        Chord first;
        Chord second;
        chords_of(convex_of(beam, placed, shape_of(placed)), beam, moved, bent, first, second);
        all.count = first.crossed ? 2u : 0u;
        all.y[0] = first.enter;
        all.y[1] = first.leave;
        all.normal_[0] = first.entry_normal;
        all.normal_[1] = first.exit_normal;
        if (TUBES) {
            all.count += second.crossed ? 2u : 0u;
            all.y[2] = second.enter;
            all.y[3] = second.leave;
            all.normal_[2] = second.entry_normal;
            all.normal_[3] = second.exit_normal;
        }
    }
    return all;
}

// About the farthest that a shape reaches from its centre along or across its axis, m.
float extent_of(Placed placed) {
    AnalyticShape shape = shape_of(placed);
    vec3 size = shape.parameters;
    float across = size.x;
    if (shape.kind == SHAPE_FRUSTUM) across += abs(size.z) * size.y;
    float along = size.y;
    if (shape.kind == SHAPE_ELLIPSOID) {
        across = 1.0 / min(size.x, size.y);
        along = 1.0 / size.z;
    }
    return max(across * placed.scale, along * placed.scale_z);
}

// Whether a line may cross a shape four times.
bool has_hole(Placed placed) {
    return TUBES && shape_of(placed).kind == SHAPE_TUBE;
}

// The crossing of a ray next to y that goes into the shape, or out of it; false where there is none.
// One before `after` belongs to a passage that is over.
bool shape_crossing_near(ShapeCrossings all, float y, float after, bool entering,
                         out uint nearest) {
    nearest = all.count;
    float least = 1e30;
    for (uint i = entering ? 0u : 1u; i < all.count; i += 2u) {
        float apart = abs(all.y[i] - y);
        if (apart < least && all.y[i] >= after) {
            least = apart;
            nearest = i;
        }
    }
    return nearest < all.count;
}
