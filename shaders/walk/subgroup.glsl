// What the lanes of a subgroup hold together. Subgroups have 8 or 16 lanes, all of them active;
// of 16 the second eight hold the same as the first, where a value is one per lane.
// Shuffles rather than broadcasts: on CPU devices they are single instructions.

#define LANE (gl_SubgroupInvocationID & 7u)
#define WORD(lanes, lane) subgroupShuffle(lanes, lane)
#define NUMBER(lanes, lane) uintBitsToFloat(subgroupShuffle(lanes, lane))

// Bits that any lane has set.
uint any_lane(uint bits) {
    bits |= subgroupShuffleXor(bits, 1u);
    bits |= subgroupShuffleXor(bits, 2u);
    bits |= subgroupShuffleXor(bits, 4u);
    if (gl_SubgroupSize > 8u) bits |= subgroupShuffleXor(bits, 8u);
    return bits;
}

uint most_of_lanes(uint n) {
    n = max(n, subgroupShuffleXor(n, 1u));
    n = max(n, subgroupShuffleXor(n, 2u));
    n = max(n, subgroupShuffleXor(n, 4u));
    if (gl_SubgroupSize > 8u) n = max(n, subgroupShuffleXor(n, 8u));
    return n;
}

vec4 least_of_lanes(vec4 v) {
    v = min(v, subgroupShuffleXor(v, 1u));
    v = min(v, subgroupShuffleXor(v, 2u));
    v = min(v, subgroupShuffleXor(v, 4u));
    if (gl_SubgroupSize > 8u) v = min(v, subgroupShuffleXor(v, 8u));
    return v;
}

// One stack for all: entry i lies in lane i % 8 of bank i / 8.
struct Stack {
    uvec2 banks[STACK / 8u];
    uint height;
};

Stack stack_begin() {
    Stack stack;
    stack.height = 0u;
    [[unroll]] for (uint b = 0u; b < STACK / 8u; b++) stack.banks[b] = uvec2(0u);
    return stack;
}

void stack_push(inout Stack stack, uvec2 entry) {
    [[unroll]] for (uint b = 0u; b < STACK / 8u; b++) {
        if (8u * b + LANE == stack.height) stack.banks[b] = entry;
    }
    stack.height += 1u;
}

uvec2 stack_pop(inout Stack stack) {
    stack.height -= 1u;
    uvec2 entry = stack.banks[0];
    [[unroll]] for (uint b = 1u; b < STACK / 8u; b++) {
        if (stack.height >> 3 == b) entry = stack.banks[b];
    }
    uint lane = stack.height & 7u;
    return uvec2(WORD(entry.x, lane), WORD(entry.y, lane));
}
