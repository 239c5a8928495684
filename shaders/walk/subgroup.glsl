// Values held by the lanes of a subgroup together. Subgroups have 8 or 16 lanes, all of them active; of
// 16 the second eight hold the same as the first, for values with one per lane. Shuffles rather than
// broadcasts: on CPU devices they are single instructions.

#define LANE (gl_SubgroupInvocationID & (BUNDLE_LANES - 1u))
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

// A record of at most three rows of words: word i lies in lane i % 8 of row i / 8. Where each
// field begins comes from the struct (NODE_ORIGIN, ...).
struct Record {
    uint first;
    uint second;
    uint third;
};

// Record `index` of an array, of `size` words.
Record record_at(Words words, uint index, uint size) {
    uint at = index * size;
    uint last = at + size - 1u;
    Record record = Record(words.at[min(at + LANE, last)], 0u, 0u);
    if (size > BUNDLE_LANES) record.second = words.at[min(at + BUNDLE_LANES + LANE, last)];
    if (size > 2u * BUNDLE_LANES) record.third = words.at[min(at + 2u * BUNDLE_LANES + LANE, last)];
    return record;
}

uint row_of(Record record, uint at) {
    return at < BUNDLE_LANES ? record.first
        : (at < 2u * BUNDLE_LANES ? record.second : record.third);
}

uint word_of(Record record, uint at) {
    return WORD(row_of(record, at), at % BUNDLE_LANES);
}

float number_of(Record record, uint at) {
    return NUMBER(row_of(record, at), at % BUNDLE_LANES);
}

vec3 numbers_of(Record record, uint at) {
    return vec3(number_of(record, at), number_of(record, at + 1u), number_of(record, at + 2u));
}

// The first or second word of a field, both in one row.
uint word_of_two(Record record, uint at, uint which) {
    return WORD(row_of(record, at), at % BUNDLE_LANES + which);
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
