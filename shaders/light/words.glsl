// Integers of 64 bits as a low and a high word: their sums do not depend on the order of the terms, and need no
// 64-bit atomics.

uvec2 plus(uvec2 a, uvec2 b) {
    uint low = a.x + b.x;
    return uvec2(low, a.y + b.y + (low < a.x ? 1u : 0u));
}

// In two's complement.
uvec2 negative(uvec2 value) {
    return plus(~value, uvec2(1u, 0u));
}

// Adds to the sum that begins at a word.
void add_pair(Words words, uint at, uvec2 value) {
    uint old = atomicAdd(words.at[at], value.x);
    uint high = value.y + (old + value.x < old ? 1u : 0u);
    if (high != 0u) atomicAdd(words.at[at + 1u], high);
}
