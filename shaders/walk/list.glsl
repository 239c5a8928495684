// Crossings of a straight ray, gathered in one search of the tree. Lists of a workgroup's rays are
// interleaved. Push constants of the kernel: `lists`, their `capacity`, and `stride`, the rays of a
// workgroup.

struct Gathered {
    uint first; // entry 0
    uint count; // found; more than `capacity` where the list does not hold them all
    float after; // y before which crossings are left out
    uint except; // leaf left out
};

Gathered list_begin(float after, uint except) {
    uint first = gl_WorkGroupID.x * push.capacity * push.stride + gl_LocalInvocationID.x;
    return Gathered(first, 0u, after, except);
}

Crossing list_at(Gathered list, uint i) {
    return push.lists.at[list.first + i * push.stride];
}

void list_set(Gathered list, uint i, Crossing crossing) {
    push.lists.at[list.first + i * push.stride] = crossing;
}

uint object_of(Crossing crossing) {
    return sample_.surfaces.at[crossing.surface].object;
}

// The order of crossings: y, then object, then primitive.
bool later(Crossing a, Crossing b) {
    if (a.y != b.y) return a.y > b.y;
    uint first = object_of(a);
    uint second = object_of(b);
    if (first != second) return first > second;
    return (a.facet & FACET_LEAF) > (b.facet & FACET_LEAF);
}

// Takes a crossing; each kernel has its own.
void list_add(inout Gathered list, Crossing crossing);

// A candidate of the search.
void visit(Beam beam, uint primitive, Leaf leaf, inout Gathered list) {
    Facet facet = facet_of(beam, leaf);
    if (!facet.crossed || primitive == list.except) return;
    float y = place_of(slope_of(beam), facet, beam_from_world_direction(beam, leaf.normal));
    uint own = primitive | (facet.entering ? FACET_ENTERED : 0u);
    if (y >= list.after) list_add(list, Crossing(y, own, leaf.surface & SURFACE_INDEX));
}

#ifdef PLACED
// A shape that may be crossed. `except` leaves none out: what lies behind it may be its other side.
void visit_shape(Beam beam, uint primitive, Placed placed, inout Gathered list) {
    ShapeCrossings found = shape_crossings(beam, vec2(0.0), vec2(0.0), placed);
    for (uint i = 0u; i < found.count; i++) {
        uint facet = primitive | (i % 2u == 0u ? FACET_ENTERED : 0u);
        if (found.y[i] >= list.after) {
            list_add(list, Crossing(found.y[i], facet, placed.surface));
        }
    }
}

// Unit normal of a shape at a crossing of a line, beam frame.
vec3 normal_of_shape(Beam beam, Placed placed, Crossing crossing) {
    ShapeCrossings found = shape_crossings(beam, vec2(0.0), vec2(0.0), placed);
    uint nearest;
    bool entering = (crossing.facet & FACET_ENTERED) != 0u;
    if (!shape_crossing_near(found, crossing.y, -FAR_AWAY, entering, nearest)) return vec3(0.0, -1.0, 0.0);
    return found.normal_[nearest];
}
#endif
