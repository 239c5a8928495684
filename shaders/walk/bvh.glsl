// Software backend: compressed wide BVH, one traversal, no order among children.

#include "walk/node.glsl"

// Bits of the children of a node in the way of the line at t in [near, far]: leaves below bit 24, inner
// children from bit 24 on.
uint children_met(Node node, vec3 origin, vec3 inverse, float near, float far) {
    vec3 scale = vec3(uintBitsToFloat((node.exponents & 0xffu) << 23),
                      uintBitsToFloat((node.exponents & 0xff00u) << 15),
                      uintBitsToFloat((node.exponents & 0xff0000u) << 7)) * inverse;
    vec3 offset = (node.origin - origin) * inverse;
    uint met = 0u;
    for (uint i = 0u; i < 8u; i++) {
        uint word = i >> 2;
        uint shift = (i & 3u) * 8u;
        uint meta = (node.meta[word] >> shift) & 0xffu;
        vec3 low = vec3((node.min_x[word] >> shift) & 0xffu, (node.min_y[word] >> shift) & 0xffu,
                        (node.min_z[word] >> shift) & 0xffu) * scale + offset;
        vec3 high = vec3((node.max_x[word] >> shift) & 0xffu, (node.max_y[word] >> shift) & 0xffu,
                         (node.max_z[word] >> shift) & 0xffu) * scale + offset;
        vec3 first = min(low, high);
        vec3 last = max(low, high);
        float enter = max(max(first.x, first.y), max(first.z, near));
        float leave = min(min(last.x, last.y), min(last.z, far));
        if (enter <= leave) met |= (meta >> 5) << (meta & 31u);
    }
    return met;
}

vec3 line_direction(Beam beam) {
    return world_from_beam_direction(beam, vec3(beam.slope_x, 1.0, beam.slope_z));
}

#ifdef PLACED
// A placed mesh. Its place goes with the search of its tree: to find it by the number of a facet takes
// divisions, which CPU devices do one lane at a time.
struct PlacedMesh {
    Placed placed;
    uint first; // number of a facet, less that of its leaf
};

// Hands every facet of a placed mesh in the way of the line from `near`, y, on to visit().
#define TREE traverse_own
#define TREE_OF PlacedMesh
#define TREE_VISIT(beam, near, of, leaf, all) \
    visit(beam, of.first + leaf, leaf_of_place(of.placed, leaf), all)
#include "walk/tree.glsl"
#undef TREE
#undef TREE_OF
#undef TREE_VISIT
#include "walk/candidate.glsl"
#else
#define candidate(beam, near, leaf, all) visit(beam, leaf, sample_.leaves.at[leaf], all)
#endif

#ifndef BACKEND_RAY_QUERY
#define TREE traverse_sample
#define TREE_OF uint // unused: there is one sample
#define TREE_VISIT(beam, near, of, leaf, all) candidate(beam, near, leaf, all)
#include "walk/tree.glsl"
#undef TREE
#undef TREE_OF
#undef TREE_VISIT

// Hands every candidate of the line from `near`, y, on to visit().
void traverse(Beam beam, float near, inout Gathered all) {
    vec3 origin = world_from_beam(beam, vec3(beam.x, 0.0, beam.z));
    traverse_sample(beam, near, origin, line_direction(beam), 0u, 0u, all);
}
#endif
