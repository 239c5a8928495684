// Crossings of a straight ray, gathered in one search of the tree. Lists of a workgroup's rays
// stand interleaved. Push constants of the kernel: `lists`, their `capacity`, and `stride`, the
// rays of a workgroup.

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

uint surface_at(uint leaf) {
    return sample_.leaves.at[leaf].surface & SURFACE_INDEX;
}

uint object_of(Crossing crossing) {
    return sample_.surfaces.at[surface_at(crossing.facet & FACET_LEAF)].object;
}

// The order of crossings: y, then object, then primitive.
bool later(Crossing a, Crossing b) {
    if (a.y != b.y) return a.y > b.y;
    uint first = object_of(a);
    uint second = object_of(b);
    if (first != second) return first > second;
    return (a.facet & FACET_LEAF) > (b.facet & FACET_LEAF);
}

// The crossing of a leaf, where the ray crosses it behind `after`.
bool crosses(Beam beam, uint leaf_index, Gathered list, out Crossing crossing) {
    crossing = Crossing(0.0, leaf_index);
    Leaf leaf = sample_.leaves.at[leaf_index];
    Facet facet = facet_of(beam, leaf);
    if (!facet.crossed || leaf_index == list.except) return false;
    crossing.y = place_of(slope_of(beam), facet, beam_from_world(beam, leaf.normal));
    if (facet.entering) crossing.facet |= FACET_ENTERED;
    return crossing.y >= list.after;
}
