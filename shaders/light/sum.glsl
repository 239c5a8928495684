// Sums of light in 64-bit fixed point, 2^-32 of open beam, as two words: integer sums do not
// depend on the order of their terms, and need no 64-bit atomics.

void add_light(Words sums, uint index, float value) {
    if (!(value > 0.0)) return;
    float whole = floor(value);
    uint low = uint((value - whole) * 4294967296.0);
    uint high = uint(whole);
    uint old = atomicAdd(sums.at[2u * index], low);
    if (old + low < old) high += 1u;
    if (high != 0u) atomicAdd(sums.at[2u * index + 1u], high);
}

// Index of a pixel and step of the band; false outside it.
bool place_of_light(Light light, int row, int pixel, uint mask_step, out uint index) {
    int r = row - light.first_row;
    index = (mask_step * light.row_count + uint(r)) * light.column_count + uint(pixel);
    return r >= 0 && r < int(light.row_count) && pixel >= 0 && pixel < int(light.column_count);
}
