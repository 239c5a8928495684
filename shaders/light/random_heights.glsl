// Masks whose apertures end along z, for single rays: the part of the path between the faces of a mask that lies
// in apertures. Lengths along z are rows on the detector, downwards from the upper end of the row of the pixel.

// Part of u in `range` in which at + way * u lies between two ends.
vec2 part_between(vec2 range, float at, float way, float low, float high) {
    if (abs(way) < 1e-12) return at > low && at < high ? range : vec2(0.0);
    vec2 ends = (vec2(low, high) - at) / way;
    return vec2(max(range.x, min(ends.x, ends.y)), min(range.y, max(ends.x, ends.y)));
}

// Share of the path of a ray in apertures of a strip, between the heights `range` of its path.
float share_in_strip(Mask mask, MaskHeights of, uint strip, vec2 range, float x, float way) {
    float half_way = 0.5 * abs(way);
    int from = int(floor((x - half_way) / mask.period - 0.5));
    int to = int(ceil((x + half_way) / mask.period + 0.5));
    float open = 0.0;
    for (int k = from; k <= to; k++) {
        for (uint i = 0u; i < MaskStrips(of.strips).at[strip].count; i++) {
            float low = float(k) * mask.period + Apertures(MaskStrips(of.strips).at[strip].apertures).at[i].low;
            float high = float(k) * mask.period + Apertures(MaskStrips(of.strips).at[strip].apertures).at[i].high;
            vec2 inside = part_between(range, x, way, low, high);
            open += max(inside.y - inside.x, 0.0);
        }
    }
    return open;
}

// Share of the path of a ray that lies in apertures: it goes through `place` (m along x, rows along z, from the
// centre of a period) and moves by `way` between the faces.
float open_share_of_path(Mask mask, MaskHeights heights, vec2 place, vec2 way) {
    float half_way = 0.5 * abs(way.y);
    int from = int(floor((place.y - half_way) / heights.period - 0.5));
    int to = int(ceil((place.y + half_way) / heights.period + 0.5));
    float open = 0.0;
    for (int k = from; k <= to; k++) {
        for (uint i = 0u; i < heights.count; i++) {
            float top = float(k) * heights.period + MaskStrips(heights.strips).at[i].top;
            float bottom = float(k) * heights.period + MaskStrips(heights.strips).at[i].bottom;
            vec2 range = part_between(vec2(-0.5, 0.5), place.y, way.y, top, bottom);
            if (range.y > range.x) {
                open += share_in_strip(mask, heights, i, range, place.x, way.x);
            }
        }
    }
    return open;
}

// Transmission of the path of a ray through bars and substrate: `place` from the centre of a period, `slope` along x and
// downwards.
float transmission_of_path(Mask mask, MaskHeights heights, vec2 place, vec2 slope, float sec) {
    vec2 way = slope * vec2(mask.thickness, heights.thickness);
    float plate = through_substrate(mask, sec);
    float open = open_share_of_path(mask, heights, place, way);
    if (mask.attenuation > 0.0) return plate * exp(-mask.attenuation * sec * (1.0 - open));
    return open > 0.5 ? plate : plate * mask.transmission;
}
