// Sums of light in 64-bit fixed point, 2^-32 of open beam.

#include "light/words.glsl"

// Low and high word of a value, rounded up if its remainder exceeds the threshold in [0, 1): thousands
// of small terms rounded down would lose a part of their sum. Negative values are in two's complement.
uvec2 fixed_point(float value, float threshold) {
    float size = abs(value);
    if (!(size > 0.0)) return uvec2(0u);
    float whole = floor(size);
    float scaled = (size - whole) * 4294967296.0;
    float below = floor(scaled);
    uvec2 words = uvec2(uint(below) + (scaled - below > threshold ? 1u : 0u), uint(whole));
    return value < 0.0 ? negative(words) : words;
}

void add_words(Words sums, uint index, uvec2 value) {
    add_pair(sums, 2u * index, value);
}

// Index of a pixel and step of the band; false outside it.
bool place_of_light(IlluminationParams light, int row, int pixel, uint mask_step, out uint index) {
    int r = row - light.first_row;
    index = (mask_step * light.row_count + uint(r)) * light.column_count + uint(pixel);
    return r >= 0 && r < int(light.row_count) && pixel >= 0 && pixel < int(light.column_count);
}
