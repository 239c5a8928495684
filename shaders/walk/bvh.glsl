// Software backend: compressed wide BVH, one traversal per walk, no order among children.

const uint STACK = 32u; // the host refuses deeper trees

// The part of children_met() of one child. Written out per child rather than as a loop, and with
// near and far sides chosen by the sign of the direction once per node.
#define CHILD(SHIFT)                                                                             \
    {                                                                                            \
        vec3 first = vec3(bitfieldExtract(first_x, SHIFT, 8), bitfieldExtract(first_y, SHIFT, 8), \
                          bitfieldExtract(first_z, SHIFT, 8)) * scale + offset;                  \
        vec3 last = vec3(bitfieldExtract(last_x, SHIFT, 8), bitfieldExtract(last_y, SHIFT, 8),   \
                         bitfieldExtract(last_z, SHIFT, 8)) * scale + offset;                    \
        float enter = max(max(first.x, first.y), max(first.z, near));                            \
        float leave = min(min(last.x, last.y), min(last.z, far));                                \
        uint child = bitfieldExtract(meta, SHIFT, 8);                                            \
        met |= enter <= leave ? (child >> 5) << (child & 31u) : 0u;                              \
    }

#define FOUR_CHILDREN(W)                                                                         \
    {                                                                                            \
        uint meta = node.meta[W];                                                                \
        uint first_x = inverse.x < 0.0 ? node.max_x[W] : node.min_x[W];                          \
        uint last_x = inverse.x < 0.0 ? node.min_x[W] : node.max_x[W];                           \
        uint first_y = inverse.y < 0.0 ? node.max_y[W] : node.min_y[W];                          \
        uint last_y = inverse.y < 0.0 ? node.min_y[W] : node.max_y[W];                           \
        uint first_z = inverse.z < 0.0 ? node.max_z[W] : node.min_z[W];                          \
        uint last_z = inverse.z < 0.0 ? node.min_z[W] : node.max_z[W];                           \
        CHILD(0) CHILD(8) CHILD(16) CHILD(24)                                                    \
    }

// Bits of the children of a node that the line may meet at t in [near, far]:
// leaves below bit 24, inner children from bit 24 on.
uint children_met(Node node, vec3 origin, vec3 inverse, float near, float far) {
    vec3 scale = vec3(uintBitsToFloat((node.exponents & 0xffu) << 23),
                      uintBitsToFloat((node.exponents & 0xff00u) << 15),
                      uintBitsToFloat((node.exponents & 0xff0000u) << 7)) * inverse;
    vec3 offset = (node.origin - origin) * inverse;
    uint met = 0u;
    FOUR_CHILDREN(0)
    FOUR_CHILDREN(1)
    return met;
}

vec3 line_direction(Beam beam) {
    vec3 d = world_from_beam(beam, vec3(beam.slope_x, 1.0, beam.slope_z));
    // A zero component would give 0 * infinity in the slab test.
    return mix(d, vec3(1e-12), lessThan(abs(d), vec3(1e-12)));
}

// Takes the next inner child off a group (x: base, y: bits from 24 on and the inner mask).
uint pop_child(inout uvec2 group) {
    uint bit = uint(findMSB(group.y));
    group.y &= ~(1u << bit);
    uint slot = bit - 24u;
    return group.x + bitCount(group.y & 0xffu & ((1u << slot) - 1u));
}

#define TRAVERSE(origin, inverse, NEAR, FAR, VISIT)                                              \
    uvec2 stack[STACK];                                                                          \
    uint height = 0u;                                                                            \
    uvec2 group = uvec2(0u, 0x80000000u);                                                        \
    while (true) {                                                                               \
        if (group.y < 0x01000000u) {                                                             \
            if (height == 0u) break;                                                             \
            height -= 1u;                                                                        \
            group = stack[height];                                                               \
        }                                                                                        \
        uint index = pop_child(group);                                                           \
        if (group.y >= 0x01000000u) {                                                            \
            stack[height] = group;                                                               \
            height += 1u;                                                                        \
        }                                                                                        \
        Node node = sample_.nodes.at[index];                                                     \
        uint met = children_met(node, origin, inverse, NEAR, FAR);                               \
        group = uvec2(node.child_base, (met & 0xff000000u) | (node.exponents >> 24));            \
        uint leaves = met & 0x00ffffffu;                                                         \
        while (leaves != 0u) {                                                                   \
            uint bit = uint(findLSB(leaves));                                                    \
            leaves &= leaves - 1u;                                                               \
            uint primitive = node.leaf_base + bit;                                               \
            VISIT;                                                                               \
        }                                                                                        \
    }

// Hands every candidate of the whole line to visit().
void walk_all(Beam beam, Floats moments, inout Walk walk) {
    vec3 origin = world_from_beam(beam, vec3(beam.x, 0.0, beam.z));
    vec3 inverse = 1.0 / line_direction(beam);
    TRAVERSE(origin, inverse, -1e30, 1e30,
             visit(beam, sample_.leaves.at[primitive], moments, walk))
}
#ifdef PACKETS
#include "walk/packet.glsl"
#endif

// The next crossing after (y, id) in the order (y, primitive).
bool next(Beam beam, float y, uint id, out Crossing crossing) {
    crossing = no_crossing();
    vec3 origin = world_from_beam(beam, vec3(beam.x, 0.0, beam.z));
    vec3 inverse = 1.0 / line_direction(beam);
    TRAVERSE(origin, inverse, y - order_slack(y), crossing.y + order_slack(crossing.y),
             offer(beam, primitive, 0u, y, id, crossing))
    return crossing.found;
}
