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

// The slope between neighbours at lower and at higher coordinates, of those that count.
float slope_between(float own, float at, vec2 values, vec2 places, bool has_low, bool has_high) {
    float low = has_low ? (own - values.x) / (at - places.x) : 0.0;
    float high = has_high ? (values.y - own) / (places.y - at) : 0.0;
    return has_low && has_high ? limited(low, high) : low + high;
}

RaySlopes slopes_of(Found own, Found found[4], bool same[4]) {
    RaySlopes slopes;
    for (uint axis = 0u; axis < 2u; axis++) {
        Found a = found[2u * axis];
        Found b = found[2u * axis + 1u];
        bool has_a = same[2u * axis];
        bool has_b = same[2u * axis + 1u];
        vec2 places = vec2(a.at[axis], b.at[axis]);
        slopes.depth[axis] =
            slope_between(own.depth, own.at[axis], vec2(a.depth, b.depth), places, has_a, has_b);
        slopes.displacement[axis] = slope_between(
            own.displacement, own.at[axis], vec2(a.displacement, b.displacement), places, has_a, has_b);
    }
    return slopes;
}
