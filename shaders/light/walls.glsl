// Bars whose walls are slanted, or that have several layers: both edges of an aperture have soft edges of their own
// (docs/developers/numerics.md, "Soft edges of bars"). Shadows are narrower than apertures and bars.

// Place of a soft edge: its mean and variance, counted outwards from its inner end as a share of the shadow.
struct EdgePlace {
    float mean;
    float variance;
};

// 1 - exp(-depth), with the digits of small depths.
float stopped(float depth) {
    return depth < 0.05 ? depth * (1.0 - depth * (0.5 - depth * (1.0 / 6.0 - depth / 24.0))) : 1.0 - exp(-depth);
}

// Third root of the density of a soft edge in a layer of the bars, divided by the root of exp(-depth).
float weight_of(BarLayer own) {
    return own.attenuation > 0.0 ? pow(own.thickness / own.attenuation, 2.0 / 3.0) : 0.0;
}

// The depth below which both soft edges have this much of the third root of their densities, or all of it (y) up to
// `depth` (x).
vec2 depth_with(Mask mask, float depth, float most) {
    uint first = 0u;
    uint last = mask.bar_layer_count - 1u;
    BarLayer low = BarLayers(mask.bar_layers).at[first];
    BarLayer high = BarLayers(mask.bar_layers).at[last];
    float low_end = low.attenuation * depth;
    float high_end = high.attenuation * depth;
    float at = 0.0;
    float all = 0.0;
    // Borders of layers from both ends, in their order.
    for (uint i = 0u; i < 2u * mask.bar_layer_count; i++) {
        float end = max(min(min(low_end, high_end), depth), at);
        float weight = 3.0 * (weight_of(low) + weight_of(high));
        float part = weight * (exp(-at / 3.0) - exp(-end / 3.0));
        if (all + part >= most) return vec2(min(-3.0 * log(exp(-at / 3.0) - (most - all) / weight), end), most);
        all += part;
        at = end;
        if (low_end <= end && first + 1u < mask.bar_layer_count) {
            first++;
            low = BarLayers(mask.bar_layers).at[first];
            low_end += low.attenuation * depth;
        } else if (low_end <= end) {
            low_end = depth;
        }
        if (high_end <= end && last > 0u) {
            last--;
            high = BarLayers(mask.bar_layers).at[last];
            high_end += high.attenuation * depth;
        } else if (high_end <= end) {
            high_end = depth;
        }
    }
    return vec2(depth, all);
}

// Ends of a layer of the soft edges, as depths.
vec2 depths_of(Mask mask, float depth, uint index, uint layers) {
    bool is_last = index + 1u == layers;
    if (mask.bar_layer_count == 1u) {
        float fall = (1.0 - exp(-depth / 3.0)) / float(layers);
        return vec2(-3.0 * log(1.0 - fall * float(index)),
                    is_last ? depth : -3.0 * log(1.0 - fall * float(index + 1u)));
    }
    float each = depth_with(mask, depth, 1e30).y / float(layers);
    return vec2(index == 0u ? 0.0 : depth_with(mask, depth, each * float(index)).x,
                is_last ? depth : depth_with(mask, depth, each * float(index + 1u)).x);
}

// Place of the part of a soft edge between two depths, at each of which light has passed as much attenuation.
// `sourceward`: light has passed the part of the bar that faces the source.
EdgePlace place_between(Mask mask, float attenuation, float from, float to, bool sourceward) {
    float all = 0.0;
    EdgePlace place = EdgePlace(0.0, 0.0);
    float depth = 0.0;
    float share = 0.0;
    for (uint i = 0u; i < mask.bar_layer_count; i++) {
        BarLayer own = BarLayers(mask.bar_layers).at[sourceward ? i : mask.bar_layer_count - 1u - i];
        float thick = own.attenuation * attenuation;
        float end = i + 1u == mask.bar_layer_count ? to : min(depth + thick, to);
        float begin = max(from, depth);
        if (end > begin && thick > 0.0) {
            float per = own.thickness / thick;
            float mean = share + per * (begin - depth + edge_mean(end - begin));
            // Means are of all parts so far.
            float light = exp(from - begin) * stopped(end - begin);
            float off = mean - place.mean;
            float whole = all + light;
            place.mean += off * light / whole;
            place.variance += (per * per * edge_variance(end - begin) - place.variance) * light / whole
                + off * off * all * light / (whole * whole);
            all = whole;
        }
        depth += thick;
        share += own.thickness;
    }
    return place;
}

// Variance of the wider soft edge of an aperture, m2.
float widest_variance(Mask mask, Bars bars, float slope) {
    float shadow = mask.thickness * slope;
    float first = place_between(mask, bars.depth, 0.0, bars.depth, true).variance;
    float last = place_between(mask, bars.depth, 0.0, bars.depth, false).variance;
    return shadow * shadow * max(first, last);
}

// A layer of the soft edges, as of straight bars. Light that runs away from a wall on its way has passed the part of the
// bar that faces the source. `slopes`: dx/dy against the walls at both edges.
Layer layer_of(Mask mask, Bars bars, vec2 slopes, uint index, uint layers) {
    if (!(bars.depth > 0.0)) {
        // Of averaged masks, whose edges have the places of their cells.
        vec2 shadow = mask.thickness * slopes;
        return Layer(bars.open, 0.0, vec2(0.0), shadow * shadow * mask.edge_variance, vec2(0.0));
    }
    vec2 ends = depths_of(mask, bars.depth, index, layers);
    float share = exp(-ends.x) * stopped(ends.y - ends.x) / stopped(bars.depth);
    EdgePlace low = place_between(mask, bars.depth, ends.x, ends.y, slopes.x > 0.0);
    EdgePlace high = place_between(mask, bars.depth, ends.x, ends.y, slopes.y < 0.0);
    vec2 narrowing = mask.thickness * (0.5 - vec2(low.mean, high.mean));
    vec2 shadow = mask.thickness * slopes;
    return Layer(bars.open * share, 0.0, narrowing, shadow * shadow * vec2(low.variance, high.variance),
                 narrowing * narrowing);
}

// Least variance of both edges of a layer.
float common_variance(Layer layer) {
    return min(layer.variance.x, layer.variance.y);
}
