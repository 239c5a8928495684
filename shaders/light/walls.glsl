// Bars whose walls are slanted, or that have several layers: both edges of an aperture have soft edges of their own
// (docs/physics.md, "Tapered bars and bars of layers"). Shadows are narrower than apertures and bars.

// Place of a soft edge: its mean and variance, counted outwards from its inner end as a share of the shadow.
struct EdgePlace {
    float mean;
    float variance;
};

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
            float light = exp(from - begin) * (1.0 - exp(begin - end));
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
    float fall = (1.0 - exp(-bars.depth / 3.0)) / float(layers);
    bool last = index + 1u == layers;
    float from = -3.0 * log(1.0 - fall * float(index));
    float to = last ? bars.depth : -3.0 * log(1.0 - fall * float(index + 1u));
    float share = exp(-from) * (1.0 - exp(from - to)) / (1.0 - exp(-bars.depth));
    EdgePlace low = place_between(mask, bars.depth, from, to, slopes.x > 0.0);
    EdgePlace high = place_between(mask, bars.depth, from, to, slopes.y < 0.0);
    vec2 narrowing = mask.thickness * (0.5 - vec2(low.mean, high.mean));
    vec2 shadow = mask.thickness * slopes;
    return Layer(bars.open * share, 0.0, narrowing, shadow * shadow * vec2(low.variance, high.variance),
                 narrowing * narrowing);
}

// Least variance of both edges of a layer.
float common_variance(Layer layer) {
    return min(layer.variance.x, layer.variance.y);
}
