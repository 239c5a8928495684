// Slopes of the result of a ray, from neighbours that crossed the same surfaces.

// Changes per m of x and per row.
struct RaySlopes {
    vec2 depth;
    vec2 displacement;
};

// Van Leer's mean of the slopes to both sides.
float limited(float a, float b) {
    return a * b > 0.0 ? 2.0 * a * b / (a + b) : 0.0;
}

// The slope along an axis, from the neighbours at its lower and its higher side that count. They lie diagonally where
// they are of other sizes: the change along the other axis is subtracted.
float slope_along(uint axis, float own, vec2 at, float low, vec2 low_at, float high, vec2 high_at, bvec2 counts, float across) {
    uint other = 1u - axis;
    float a = counts.x ? (own - low + across * (low_at[other] - at[other])) / (at[axis] - low_at[axis]) : 0.0;
    float b = counts.y ? (high - own - across * (high_at[other] - at[other])) / (high_at[axis] - at[axis]) : 0.0;
    return counts.x && counts.y ? limited(a, b) : a + b;
}

RaySlopes slopes_of(Found own, Found found[4], bool same[4]) {
    RaySlopes slopes = RaySlopes(vec2(0.0), vec2(0.0));
    for (uint turn = 0u; turn < 3u; turn++) {
        uint axis = turn == 1u ? 0u : 1u;
        Found a = found[2u * axis];
        Found b = found[2u * axis + 1u];
        bvec2 counts = bvec2(same[2u * axis], same[2u * axis + 1u]);
        slopes.depth[axis] = slope_along(axis, own.depth, own.at, a.depth, a.at, b.depth, b.at, counts,
                                         slopes.depth[1u - axis]);
        slopes.displacement[axis] = slope_along(axis, own.displacement, own.at, a.displacement, a.at,
                                                b.displacement, b.at, counts, slopes.displacement[1u - axis]);
    }
    return slopes;
}
