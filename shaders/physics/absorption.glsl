// Light behind an optical depth that is linear over a cell, as `engine/simulate/sampling/absorption.rs`.

// Share that passes, on average. `middle`: depth in the middle of the cell; `change`: of the depth over it.
float mean_passed(float middle, float change) {
    float size = abs(change);
    float square = change * change;
    // The difference of a small change would lose its digits.
    return size < 0.5 ? exp(-middle) * (1.0 + square * (1.0 / 24.0 + square / 1920.0))
        : exp(0.5 * size - middle) * (1.0 - exp(-size)) / size;
}

// Change over the cell, over the light in the middle, of the linear light with the centre of light of the exponential; of
// a large change the linear light is 0 at the dark end.
float linear_change(float change) {
    float bounded = clamp(change, -2.1548, 2.1548);
    return bounded / (1.0 + bounded * bounded / 60.0);
}
