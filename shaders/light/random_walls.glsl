// Exact paths through bars whose walls are slanted, or that have several layers.

// Share of the way of a ray from `from` to `to` along the axis (m from the middle plane, where the ray is at x) that lies
// in apertures; `shift`: of the lattice.
float open_way(Mask mask, float x, float shift, float slope, float from, float to) {
    float reach = max(abs(from), abs(to)) * (abs(slope) + abs(mask.taper));
    int first = int(floor((x - reach - shift) / mask.period - 0.5));
    int last = int(ceil((x + reach - shift) / mask.period + 0.5));
    float open = 0.0;
    for (int k = first; k <= last; k++) {
        for (uint i = 0u; i < mask.count; i++) {
            Aperture aperture = aperture_of(mask, Place(k, i));
            // Inside of the low wall is beyond - x / slope along the axis, and so of the high wall.
            float low = float(k) * mask.period + shift + aperture.low - x;
            float high = float(k) * mask.period + shift + aperture.high - x;
            vec2 walls = vec2(slope + mask.taper, mask.taper - slope);
            vec2 way = vec2(from, to);
            if (walls.x == 0.0 && low > 0.0) continue;
            if (walls.y == 0.0 && high < 0.0) continue;
            if (walls.x > 0.0) way.x = max(way.x, low / walls.x);
            if (walls.x < 0.0) way.y = min(way.y, low / walls.x);
            if (walls.y > 0.0) way.x = max(way.x, -high / walls.y);
            if (walls.y < 0.0) way.y = min(way.y, -high / walls.y);
            open += max(way.y - way.x, 0.0);
        }
    }
    return open / (to - from);
}

// Transmission of the exact path through bars and substrate.
float mask_transmission(Mask mask, float x, float shift, float slope, float sec) {
    if (mask.present == 0u) return 1.0;
    float plate = through_substrate(mask, sec);
    if (!(mask.attenuation > 0.0)) {
        return open_share(mask, x, x, shift) > 0.5 ? plate : plate * mask.transmission;
    }
    float depth = 0.0;
    float from = -0.5 * mask.thickness;
    for (uint i = 0u; i < mask.bar_layer_count; i++) {
        BarLayer own = BarLayers(mask.bar_layers).at[i];
        float to = from + own.thickness * mask.thickness;
        depth += own.attenuation * (1.0 - open_way(mask, x, shift, slope, from, to));
        from = to;
    }
    return plate * exp(-mask.attenuation * sec * depth);
}
