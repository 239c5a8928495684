// Squared error of rays that are spread evenly, of the square that a step over their distance leaves: that where few
// rays see a jump, which may lie anywhere between two; six times as much where any two differ alike, since each is then a
// random sample. The change to the ray after the next is twice as large in the first case.
float even_part(uint patch_index) {
    if (!is_even(patch_index)) return 1.0;
    return 1.0 + 5.0 * (2.0 - growth_of(patch_index));
}

// Largest square of the error of a mask step of a patch, of the square of the budget: of its light, and with
// the displacement.
float worst_square(uint patch_index, bool turns) {
    uint first = step_sums_of(patch_index);
    uint of_all = first + 2u * P.steps;
    uint second = of_all + 2u;
    uvec2 most = uvec2(0u);
    for (uint step_ = 0u; step_ < P.steps; step_++) {
        uvec2 sum = uvec2(P.sums.at[first + 2u * step_], P.sums.at[first + 2u * step_ + 1u]);
        if (turns) {
            sum = plus(sum, uvec2(P.sums.at[second + 2u * step_], P.sums.at[second + 2u * step_ + 1u]));
        }
        if (sum.y > most.y || (sum.y == most.y && sum.x > most.x)) most = sum;
    }
    float low = float(most.x) + float(P.sums.at[of_all]);
    float high = float(most.y) + float(P.sums.at[of_all + 1u]);
    return even_part(patch_index) * (low + 4294967296.0 * high) / UNIT;
}
