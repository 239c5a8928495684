// Which of a node's children comes next.

// Takes the next inner child off a group (x: base, y: bits from 24 on and the inner mask).
uint pop_child(inout uvec2 group) {
    uint bit = uint(findMSB(group.y));
    group.y &= ~(1u << bit);
    uint slot = bit - 24u;
    return group.x + bitCount(group.y & 0xffu & ((1u << slot) - 1u));
}
