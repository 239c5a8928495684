// A search of a tree: TREE hands every leaf in the way of a line from `near`, in lengths of `direction`,
// on to TREE_VISIT, with the tree `of`. Loops test at their end: CPU devices run a body once more, idle,
// for a test at its beginning.
void TREE(Beam beam, float near, vec3 origin, vec3 direction, uint root, TREE_OF of,
          inout Gathered all) {
    // A zero component would give 0 * infinity in the slab test.
    vec3 inverse = 1.0 / mix(direction, vec3(1e-12), lessThan(abs(direction), vec3(1e-12)));
    uvec2 stack[STACK];
    uint height = 0u;
    uvec2 group = uvec2(root, 0x80000000u);
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
                TREE_VISIT(beam, near, of, node.leaf_base + bit, all);
            } while (leaves != 0u);
        }
    } while (group.y >= 0x01000000u || height > 0u);
}
