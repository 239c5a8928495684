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
    RaySlopes slopes = RaySlopes(vec2(0.0), vec2(0.0));
    slopes.depth.y = slope_along(depth_z, along_z, aside_z, same[2], same[3], 0.0);
    slopes.depth.x = slope_along(depth_x, along_x, aside_x, same[0], same[1], slopes.depth.y);
    slopes.depth.y = slope_along(depth_z, along_z, aside_z, same[2], same[3], slopes.depth.x);
    slopes.displacement.y = slope_along(moved_z, along_z, aside_z, same[2], same[3], 0.0);
    slopes.displacement.x =
        slope_along(moved_x, along_x, aside_x, same[0], same[1], slopes.displacement.y);
    slopes.displacement.y =
        slope_along(moved_z, along_z, aside_z, same[2], same[3], slopes.displacement.x);
    return slopes;
}

// Linear result of a rectangle along x.
RaySlopes slopes_along_x(Rectangle g, uint index) {
    if (is_even(g.patch_index)) return RaySlopes(vec2(0.0), vec2(0.0));
    Found own = found_of(g, index, vec2(0.0));
    vec2 x = beside_x(g);
    Found found[4];
    bool same[4] = bool[4](false, false, false, false);
    found[0] = found_at(index, g.patch_index, x.x, own.at.y);
    found[1] = found_at(index, g.patch_index, x.y, own.at.y);
    found[2] = found[3] = own;
    for (uint side = 0u; side < 2u; side++) {
        same[side] = found[side].known && alike(found[side], own);
    }
    RaySlopes slopes = slopes_of(own, found, same);
    float width = g.x_high - g.x_low;
    float steepest = 0.5 * P.magnification;
    slopes.displacement.x = clamp(slopes.displacement.x, -steepest, steepest);
    slopes.depth.x = clamp(slopes.depth.x, -abs(g.optical_depth) / width, abs(g.optical_depth) / width);
    return slopes;
}
