// The rays of a subgroup walk the tree together: what any of them may meet is loaded once for all,
// a word per lane, and passed around. Every ray meets its triangles in the order of the single
// walk, so that no bit of its sums depends on its company.
// Subgroups have 8 or 16 lanes, all of them active.

const uint NODE_WORDS = 20u;
const uint LEAF_WORDS = 13u;

#define WORD(k) subgroupBroadcast((k) < 8 ? low : (k) < 16 ? middle : high, (k) & 7)
#define NUMBER(k) uintBitsToFloat(WORD(k))

Node load_node(Words nodes, uint index) {
    uint lane = gl_SubgroupInvocationID & 7u;
    uint first = index * NODE_WORDS;
    uint low = nodes.at[first + lane];
    uint middle = nodes.at[first + 8u + lane];
    uint high = nodes.at[first + 16u + (lane & 3u)];
    return Node(vec3(NUMBER(0), NUMBER(1), NUMBER(2)), WORD(3), WORD(4), WORD(5),
                uint[2](WORD(6), WORD(7)), uint[2](WORD(8), WORD(9)),
                uint[2](WORD(10), WORD(11)), uint[2](WORD(12), WORD(13)),
                uint[2](WORD(14), WORD(15)), uint[2](WORD(16), WORD(17)),
                uint[2](WORD(18), WORD(19)));
}

Leaf load_leaf(Words leaves, uint primitive) {
    uint lane = gl_SubgroupInvocationID & 7u;
    uint first = primitive * LEAF_WORDS;
    uint low = leaves.at[first + lane];
    uint middle = leaves.at[first + 8u + min(lane, 4u)];
    uint high = 0u;
    return Leaf(vec3(NUMBER(0), NUMBER(1), NUMBER(2)), vec3(NUMBER(3), NUMBER(4), NUMBER(5)),
                vec3(NUMBER(6), NUMBER(7), NUMBER(8)), vec3(NUMBER(9), NUMBER(10), NUMBER(11)),
                WORD(12));
}

// Bits that any ray has set.
uint any_lane(uint bits) {
    bits |= subgroupShuffleXor(bits, 1u);
    bits |= subgroupShuffleXor(bits, 2u);
    bits |= subgroupShuffleXor(bits, 4u);
    if (gl_SubgroupSize > 8u) bits |= subgroupShuffleXor(bits, 8u);
    return subgroupBroadcastFirst(bits);
}

// Hands every candidate of the whole line to visit(); rays that are not `live` have none.
void walk_together(bool live, Beam beam, Floats moments, inout Walk walk) {
    vec3 origin = world_from_beam(beam, vec3(beam.x, 0.0, beam.z));
    vec3 inverse = 1.0 / line_direction(beam);
    Words nodes = Words(sample_.nodes);
    Words leaf_words = Words(sample_.leaves);
    uvec2 stack[STACK];
    uint height = 0u;
    uvec2 group = uvec2(0u, 0x80000000u);
    while (true) {
        if (group.y < 0x01000000u) {
            if (height == 0u) break;
            height -= 1u;
            group = stack[height];
        }
        uint index = pop_child(group);
        if (group.y >= 0x01000000u) {
            stack[height] = group;
            height += 1u;
        }
        Node node = load_node(nodes, index);
        uint mine = live ? children_met(node, origin, inverse, -1e30, 1e30) : 0u;
        uint met = any_lane(mine);
        group = uvec2(node.child_base, (met & 0xff000000u) | (node.exponents >> 24));
        uint leaves = met & 0x00ffffffu;
        while (leaves != 0u) {
            uint bit = uint(findLSB(leaves));
            leaves &= leaves - 1u;
            Leaf leaf = load_leaf(leaf_words, node.leaf_base + bit);
            if ((mine >> bit & 1u) != 0u) visit(beam, leaf, moments, walk);
        }
    }
}
