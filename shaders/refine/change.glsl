// A rectangle, and how the light that pixels record would change if its light were another.

// Standard deviation of a place spread evenly over a step.
const float SPREAD = 0.28867513;
// Error, share of the budget, below which a bound does, and nobody looks for silhouettes at the corners.
const float LITTLE = 3e-3;
// Parts of the light of a spectrum.
const uint PARTS = 4u;
// Change of the share of light that passes a window from one part of a spectrum to another, from which on parts are
// looked at one by one.
const float APART = 0.1;

// A rectangle and what its light does.
struct Own {
    Rectangle g;
    RefinedPatch patch_;
    RefinedColumn column;
    Found found;
    RaySlopes slopes;
    float passed; // share of its light that passes the sample and may be recorded
    float at;     // where it lands
    float half_;  // half the width over which it lands
    Seen seen[2]; // by the windows of each kind
    vec2 size;    // m, and rows
};

// Light of a ray that passes and may be recorded.
float recorded(Own own, Found found) {
    float row = float(own.patch_.row) + found.at.y - found.landing / P.row_pitch;
    float reach = 0.5 * own.size.y;
    bool in_rows = row + reach > float(P.recorded[0]) && row - reach < float(P.recorded[1]);
    float x = own.column.slope * P.analyser + P.magnification * found.at.x + found.displacement;
    return in_rows && abs(x) < P.half_width ? light_behind(found.depth) : 0.0;
}

// Error by a change of all light of a rectangle, share of the budget.
float error_of(Own own, float change) {
    precise float error = P.weight * (own.size.x * own.size.y) * SPREAD * change / P.light_budget;
    return error;
}

// The same, or more: windows change no faster.
float bound_of(Own own, Landed other) {
    float moved = min(abs(other.at - own.at) * max(P.part_ratios.x, 1.0) * P.steepest, 1.0);
    return abs(other.light - own.passed) + max(other.light, own.passed) * moved;
}

// A part of the light of a spectrum, which is displaced more or less than light at the constants of the rays.
Landed part_of(Own own, Landed all, uint part, float shift) {
    float place = P.magnification * own.found.at.x;
    return Landed(all.light * P.part_shares[part], place + (all.at - place) * P.part_ratios[part] + shift);
}

// Whether windows see parts of a spectrum apart: light may pass at the constants of the rays, and not at others.
bool parts_lie_apart(Own own, Landed other) {
    float place = P.magnification * own.found.at.x;
    float moved = max(abs(own.at - place), abs(other.at - place));
    return moved * (P.part_ratios.x - P.part_ratios.w) * P.steepest > APART;
}

// Largest change of the light in any pixel if it were another.
float whole_change_to(Own own, Landed other) {
    Landed before = Landed(own.passed, own.at);
    float change = 0.0;
    float by_parts = 0.0;
    bool apart = parts_lie_apart(own, other);
    for (uint kind = 0u; kind < P.window_count; kind++) {
        WindowTable table = P.windows.at[kind];
        float shift = own.column.landing[kind];
        Landed from = Landed(before.light, before.at + shift);
        Landed to = Landed(other.light, other.at + shift);
        change += table.share * change_in(table, own.seen[kind], from, to, own.half_);
        for (uint part = 0u; apart && part < PARTS && P.part_shares[part] > 0.0; part++) {
            from = part_of(own, before, part, shift);
            to = part_of(own, other, part, shift);
            by_parts += table.share * change_in(table, seen_by(table, from, own.half_), from, to, own.half_);
        }
    }
    return max(change, by_parts);
}

// The same, or a bound of it where that is small.
float change_to(Own own, Landed other) {
    float most = bound_of(own, other);
    return error_of(own, most) < LITTLE ? most : whole_change_to(own, other);
}

// Light of a ray at the place of the rectangle.
Landed landed_of(Own own, Found found) {
    return Landed(recorded(own, found), own.at + found.displacement - own.found.displacement);
}

// Sets the light that changes are counted from.
void set_light(inout Own own, Landed light) {
    own.passed = light.light;
    own.at = light.at;
    for (uint kind = 0u; kind < P.window_count; kind++) {
        Landed landed = Landed(light.light, light.at + own.column.landing[kind]);
        own.seen[kind] = seen_by(P.windows.at[kind], landed, own.half_);
    }
}
