// Sums of light in 64-bit fixed point, 2^-32 of open beam, as two words: integer sums do not
// depend on the order of their terms, and need no 64-bit atomics.

// Of low and high words.
uvec2 plus(uvec2 a, uvec2 b) {
    uint low = a.x + b.x;
    return uvec2(low, a.y + b.y + (low < a.x ? 1u : 0u));
}

// Low and high word of a value, rounded up if its remainder exceeds the threshold in [0, 1): thousands
// of small terms rounded down would lose a part of their sum. Negative values are in two's complement.
uvec2 fixed_point(float value, float threshold) {
    float size = abs(value);
    if (!(size > 0.0)) return uvec2(0u);
    float whole = floor(size);
    float scaled = (size - whole) * 4294967296.0;
    float below = floor(scaled);
    uvec2 words = uvec2(uint(below) + (scaled - below > threshold ? 1u : 0u), uint(whole));
    return value < 0.0 ? plus(~words, uvec2(1u, 0u)) : words;
}

void add_words(Words sums, uint index, uvec2 value) {
    uint old = atomicAdd(sums.at[2u * index], value.x);
    uint high = value.y + (old + value.x < old ? 1u : 0u);
    if (high != 0u) atomicAdd(sums.at[2u * index + 1u], high);
}

// Index of a pixel and step of the band; false outside it.
bool place_of_light(IlluminationParams light, int row, int pixel, uint mask_step, out uint index) {
    int r = row - light.first_row;
    index = (mask_step * light.row_count + uint(r)) * light.column_count + uint(pixel);
    return r >= 0 && r < int(light.row_count) && pixel >= 0 && pixel < int(light.column_count);
}
