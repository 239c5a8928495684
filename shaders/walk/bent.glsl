// A bent ray beside the straight line of its list of crossings, and its own crossings of the surfaces in
// that list.

struct Bent {
    Beam line;     // the straight line
    vec2 slope;    // change of slope against it
    vec2 moved;    // against it, at y = 0
    vec2 before;   // change of slope of the line itself, against the ray as it set out
    vec2 displacement; // at the analyser, against the ray as it set out
};

vec2 slope_of(Bent ray) {
    return slope_of(ray.line) + ray.slope;
}

// The line goes on as the bent ray does.
void straighten(inout Bent ray) {
    ray.line.x += ray.moved.x;
    ray.line.z += ray.moved.y;
    ray.line.slope_x += ray.slope.x;
    ray.line.slope_z += ray.slope.y;
    ray.before += ray.slope;
    ray.slope = ray.moved = vec2(0.0);
}

void bend_at(inout Bent ray, float y, vec2 bend) {
    ray.slope += bend;
    ray.displacement += bend * (ray.line.analyser - y);
    ray.moved -= bend * y;
}

vec3 sheared(Bent ray, vec3 v) {
    precise vec3 straight = sheared(ray.line, v);
    precise vec2 off = ray.moved + ray.slope * v.y;
    return vec3(straight.x - off.x, straight.y, straight.z - off.y);
}

Facet facet_of(Bent ray, Leaf leaf) {
    precise vec3 p = sheared(ray, beam_from_world(ray.line, leaf.a));
    precise vec3 q = sheared(ray, beam_from_world(ray.line, leaf.b));
    precise vec3 r = sheared(ray, beam_from_world(ray.line, leaf.c));
    return facet_of(p, q, r);
}

// The edge that the ray is farthest beyond.
uint edge_beyond(Facet f, bool entering) {
    vec3 p = f.q - f.r;
    vec3 q = f.r - f.p;
    vec3 r = f.p - f.q;
    vec3 squares = vec3(dot(p.xz, p.xz), dot(q.xz, q.xz), dot(r.xz, r.xz));
    vec3 beyond = (entering ? -1.0 : 1.0) * f.edges * inversesqrt(max(squares, 1e-36));
    // Edges decided by the rule for ties are beyond by nothing.
    beyond = mix(vec3(-1.0), max(beyond, 0.0), notEqual(f.sides, bvec3(entering)));
    if (beyond.x >= beyond.y && beyond.x >= beyond.z) return 0u;
    return beyond.y >= beyond.z ? 1u : 2u;
}

// Crossing of a bent ray and a surface.
struct Meeting {
    uint outcome;
    uint leaf;
    float y;
    vec3 normal; // beam frame
    vec3 refracts; // the normal that light is refracted by
};
const uint MEETS = 0u;
const uint MISSES = 1u; // the surface turns away before it
const uint FAR = 2u;    // too many facets away, or at an open edge

const uint STEPS = 8u; // across edges

// Where the ray crosses the surface that the straight line crosses at a leaf, at y: from facet to
// facet across the edges that it is beyond. `after`: where it may do so at the earliest.
Meeting meet(Bent ray, uint leaf_index, bool entering, float y, float after) {
    Meeting meeting = Meeting(FAR, leaf_index, 0.0, vec3(0.0), vec3(0.0));
#ifdef PLACED
    Placed placed;
    if (is_shape(leaf_index, placed)) {
        ShapeCrossings found = shape_crossings(ray.line, ray.moved, ray.slope, placed);
        uint at;
        float earliest = has_hole(placed) ? after : -FAR_AWAY;
        if (shape_crossing_near(found, y, earliest, entering, at)) {
            vec3 normal_ = found.normal_[at];
            return Meeting(MEETS, leaf_index, found.y[at], normal_, normal_);
        }
        meeting.outcome = entering ? MISSES : FAR;
        return meeting;
    }
#endif
    vec2 slope = slope_of(ray);
    for (uint steps = 0u; steps <= STEPS && leaf_index != NO_LEAF; steps++) {
        Leaf leaf = leaf_at(leaf_index);
        Facet facet = facet_of(ray, leaf);
        meeting.normal = beam_from_world_direction(ray.line, leaf.normal);
        float along = dot(meeting.normal, vec3(slope.x, 1.0, slope.y));
        bool faces = along == 0.0 || (along < 0.0) == entering;
        // Slivers may be turned over by rounding: normals decide better.
        if (!faces && (facet.area > 0.0) != entering) {
            meeting.outcome = MISSES;
            return meeting;
        }
        if (facet.crossed) {
            meeting.outcome = MEETS;
            meeting.leaf = leaf_index;
            meeting.y = place_of(slope, facet, meeting.normal);
            meeting.refracts = meeting.normal;
#ifdef PLACED
            if ((KINDS & KIND_SMOOTH) != 0u
                && sample_.surfaces.at[leaf.surface & SURFACE_INDEX].smooth_ != 0u) {
                meeting.refracts = smooth_normal(ray.line, leaf_index, facet, meeting.normal,
                                                 vec3(slope.x, 1.0, slope.y));
            }
#endif
            return meeting;
        }
        leaf_index = neighbour_of(leaf_index, edge_beyond(facet, entering));
    }
    return meeting;
}
