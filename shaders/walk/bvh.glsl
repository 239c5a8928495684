// Software backend: compressed wide BVH, one traversal, no order among children.

#include "walk/node.glsl"

// Bits of the children of a node that the line may meet at t in [near, far]:
// leaves below bit 24, inner children from bit 24 on.
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
    vec3 d = world_from_beam(beam, vec3(beam.slope_x, 1.0, beam.slope_z));
    // A zero component would give 0 * infinity in the slab test.
    return mix(d, vec3(1e-12), lessThan(abs(d), vec3(1e-12)));
}

// Hands every candidate of the line from `near`, y, on to visit().
// Loops test at their end: CPU devices run a body once more, idle, for a test at its beginning.
void traverse(Beam beam, float near, inout Gathered all) {
    vec3 origin = world_from_beam(beam, vec3(beam.x, 0.0, beam.z));
    vec3 inverse = 1.0 / line_direction(beam);
    uvec2 stack[STACK];
    uint height = 0u;
    uvec2 group = uvec2(0u, 0x80000000u);
    do {
        if (group.y < 0x01000000u) {
            height -= 1u;
            group = stack[height];
        }
        uint index = pop_child(group);
        if (group.y >= 0x01000000u) {
            stack[height] = group;
            height += 1u;
        }
        Node node = sample_.nodes.at[index];
        uint met = children_met(node, origin, inverse, near, 1e30);
        group = uvec2(node.child_base, (met & 0xff000000u) | (node.exponents >> 24));
        uint leaves = met & 0x00ffffffu;
        if (leaves != 0u) {
            do {
                uint bit = uint(findLSB(leaves));
                leaves &= leaves - 1u;
                visit(beam, node.leaf_base + bit, all);
            } while (leaves != 0u);
        }
    } while (group.y >= 0x01000000u || height > 0u);
}
