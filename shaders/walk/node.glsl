// The tree: how deep it is, and which of a node's children comes next.

const uint STACK = 32u; // the host refuses deeper trees

// Takes the next inner child off a group (x: base, y: bits from 24 on and the inner mask).
uint pop_child(inout uvec2 group) {
    uint bit = uint(findMSB(group.y));
    group.y &= ~(1u << bit);
    uint slot = bit - 24u;
    return group.x + bitCount(group.y & 0xffu & ((1u << slot) - 1u));
}
