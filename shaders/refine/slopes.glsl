// Slopes of the result of a ray, from neighbours that crossed the same surfaces.

// Changes per m of x and per row.
struct RaySlopes {
    vec2 depth;
    vec2 displacement;
    vec2 landing; // where apertures end along z; else 0
};

// Steepest landing along z, of the row that it changes over: slopes between rays close to each other may be any.
const float STEEPEST_LANDING = 0.5;

RaySlopes no_slopes() {
    return RaySlopes(vec2(0.0), vec2(0.0), vec2(0.0));
}

// Van Leer's mean of the slopes to both sides.
float limited(float a, float b) {
    return a * b > 0.0 ? 2.0 * a * b / (a + b) : 0.0;
}

// The slope along an axis, from a neighbour at lower and one at higher coordinates: changes of the value, and how far
// they lie along the axis and aside. They lie diagonally where they are of other sizes: the change along the other
// axis, of slope `across`, is subtracted.
float slope_along(vec2 rise, vec2 along, vec2 aside, bool has_low, bool has_high, float across) {
    float low = has_low ? (rise.x - across * aside.x) / along.x : 0.0;
    float high = has_high ? (rise.y - across * aside.y) / along.y : 0.0;
    return has_low && has_high ? limited(low, high) : low + high;
}

RaySlopes slopes_of(Found own, Found found[4], bool same[4]) {
    vec2 left = found[0].at - own.at;
    vec2 right = found[1].at - own.at;
    vec2 up = found[2].at - own.at;
    vec2 down = found[3].at - own.at;
    // Values of depth and displacement, at both ends along x and along z.
    vec2 depth_x = vec2(found[0].depth, found[1].depth) - own.depth;
    vec2 depth_z = vec2(found[2].depth, found[3].depth) - own.depth;
    vec2 moved_x = vec2(found[0].displacement, found[1].displacement) - own.displacement;
    vec2 moved_z = vec2(found[2].displacement, found[3].displacement) - own.displacement;
    vec2 along_x = vec2(left.x, right.x);
    vec2 aside_x = vec2(left.y, right.y);
    vec2 along_z = vec2(up.y, down.y);
    vec2 aside_z = vec2(up.x, down.x);
    RaySlopes slopes = no_slopes();
    slopes.depth.y = slope_along(depth_z, along_z, aside_z, same[2], same[3], 0.0);
    slopes.depth.x = slope_along(depth_x, along_x, aside_x, same[0], same[1], slopes.depth.y);
    slopes.depth.y = slope_along(depth_z, along_z, aside_z, same[2], same[3], slopes.depth.x);
    slopes.displacement.y = slope_along(moved_z, along_z, aside_z, same[2], same[3], 0.0);
    slopes.displacement.x =
        slope_along(moved_x, along_x, aside_x, same[0], same[1], slopes.displacement.y);
    slopes.displacement.y =
        slope_along(moved_z, along_z, aside_z, same[2], same[3], slopes.displacement.x);
    if (has_heights()) {
        vec2 landing_x = vec2(found[0].landing, found[1].landing) - own.landing;
        vec2 landing_z = vec2(found[2].landing, found[3].landing) - own.landing;
        float down = slope_along(landing_z, along_z, aside_z, same[2], same[3], 0.0);
        slopes.landing.x = slope_along(landing_x, along_x, aside_x, same[0], same[1], down);
        down = slope_along(landing_z, along_z, aside_z, same[2], same[3], slopes.landing.x);
        slopes.landing.y = clamp(down, -STEEPEST_LANDING * P.row_pitch, STEEPEST_LANDING * P.row_pitch);
    }
    return slopes;
}

// Slopes of the result of a rectangle: along x, and along z where apertures end there.
RaySlopes slopes_at(Rectangle g, uint index) {
    if (is_even(g.patch_index)) return no_slopes();
    Found own = found_of(g, index, vec2(0.0));
    vec2 x = beside_x(g);
    vec2 z = beside_z(g);
    uint sides = has_heights() ? 4u : 2u;
    Found found[4];
    bool same[4];
    for (uint side = 0u; side < 4u; side++) {
        found[side] = own;
        if (side < sides) {
            vec2 at = side < 2u ? vec2(x[side], own.at.y) : vec2(own.at.x, z[side - 2u]);
            found[side] = found_at(index, g.patch_index, at.x, at.y);
        }
        same[side] = side < sides && found[side].known && alike(found[side], own);
    }
    return slopes_of(own, found, same);
}

// Slopes as far as the linear result of a rectangle follows them along x.
RaySlopes followed(Rectangle g, RaySlopes slopes) {
    float width = g.x_high - g.x_low;
    float steepest = 0.5 * P.magnification;
    slopes.displacement.x = clamp(slopes.displacement.x, -steepest, steepest);
    slopes.depth.x = clamp(slopes.depth.x, -abs(g.optical_depth) / width, abs(g.optical_depth) / width);
    return slopes;
}

RaySlopes limited_slopes_at(Rectangle g, uint index) {
    return followed(g, slopes_at(g, index));
}

// Change of the light over the height of a rectangle, relative to its mean, for a rise of the optical depth over it:
// of the line with the same centroid.
float tilt_by_depth(float rise) {
    float t = 0.5 * rise;
    float series = t * (1.0 / 3.0 - t * t * (1.0 / 45.0 - t * t * 2.0 / 945.0));
    // Beyond 20 the quotient of tanh may overflow.
    float large = (abs(t) < 20.0 ? 1.0 / tanh(t) : sign(t)) - 1.0 / t;
    return -6.0 * (abs(t) < 0.5 ? series : large);
}

// Light of a rectangle along z, as cells behind apertures that end there have it: growth of the landing over its
// height, rows, and change of the light.
vec2 along_z(Rectangle g, RaySlopes slopes) {
    float height = g.z_high - g.z_low;
    float rise = clamp(slopes.depth.y * height, -abs(g.optical_depth), abs(g.optical_depth));
    return vec2(-slopes.landing.y * height / P.row_pitch, tilt_by_depth(rise));
}
