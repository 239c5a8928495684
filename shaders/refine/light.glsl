// How a change of a ray's result changes the recorded light.

// Points of a table of windows per period, and half its width, periods.
const float POINTS = 512.0;
const float REACH = 2.0;

// Integral of the light through the window at 0 over the landing point.
float integral_of(WindowTable table, float at) {
    Floats values = Floats(table.values);
    if (table.is_sharp != 0u) {
        float sum = 0.0;
        for (uint i = 0u; i < table.count; i += 2u) sum += clamp(at, values.at[i], values.at[i + 1u]);
        return sum;
    }
    float last = float(table.count - 1u);
    float place = clamp((at / table.period + REACH) * POINTS, 0.0, last);
    uint index = min(uint(place), table.count - 2u);
    float a = values.at[index];
    return a + (values.at[index + 1u] - a) * (place - float(index));
}

// Share of light spread evenly over [at - half, at + half] that passes the window at 0.
float passed_of(WindowTable table, float at, float half_) {
    return (integral_of(table, at + half_) - integral_of(table, at - half_)) / (2.0 * half_);
}

// Light and where it lands, from the nearest window of the first kind.
struct Landed {
    float light;
    float at;
};

// Largest change of the light in any window of a kind.
float change_in(WindowTable table, Landed a, Landed b, float half_) {
    // The table has no points within less; and the quotient keeps its digits.
    half_ = max(half_, 2.0 * table.period / POINTS);
    float home = round(a.at / table.period);
    float there = round(b.at / table.period);
    float most = 0.0;
    for (int k = -1; k <= 1; k++) {
        float centre = (home + float(k)) * table.period;
        most = max(most, abs(a.light * passed_of(table, a.at - centre, half_)
                             - b.light * passed_of(table, b.at - centre, half_)));
        if (there == home) continue;
        centre = (there + float(k)) * table.period;
        most = max(most, abs(a.light * passed_of(table, a.at - centre, half_)
                             - b.light * passed_of(table, b.at - centre, half_)));
    }
    return most;
}

// Largest change of the light in any pixel; places from the middle of the beamlet.
float change_of(RefinedColumn column, Landed a, Landed b, float half_) {
    float change = 0.0;
    for (uint kind = 0u; kind < P.window_count; kind++) {
        WindowTable table = P.windows.at[kind];
        float shift = column.landing[kind];
        change += table.share
            * change_in(table, Landed(a.light, a.at + shift), Landed(b.light, b.at + shift), half_);
    }
    return change;
}
