// An illumination curve and the Gaussian that is fitted to it.

// A e^{-t^2/2} + b, t = (offset - centre) / width; intensity above the curve's least value, in
// units of a power of two near its range; lengths in half widths of the scan.
struct Gaussian {
    float amplitude;
    float centre;
    float width;
    float background;
};

// Properties of a pixel's curve before the fit.
struct Curve {
    float least;
    float scale;      // a power of two: multiplying by it loses nothing
    float saturation; // values from here on are left out
    uint used;
    uint pixel;
    bool finite;
};

float value(Curve c, uint i) {
    return push.curves.at[i * push.pixel_count + c.pixel];
}

Curve summarise(uint pixel, out float range) {
    Curve c = Curve(1e38, 1.0, push.saturation, 0u, pixel, true);
    float most = -1e38;
    for (uint i = 0; i < push.step_count; i++) {
        float y = value(c, i);
        // Infinities and NaN have all bits of the exponent set.
        c.finite = c.finite && (floatBitsToUint(y) & 0x7f800000u) != 0x7f800000u;
        if (y >= c.saturation) continue;
        c.used++;
        c.least = min(c.least, y);
        most = max(most, y);
    }
    range = c.used > 0u ? most - c.least : 0.0;
    uint exponent = clamp((floatBitsToUint(range) >> 23) & 255u, 2u, 250u);
    c.scale = uintBitsToFloat((253u - exponent) << 23);
    return c;
}

// The curve with the background that follows from its area, where that is no unknown.
Gaussian tied(Curve c, Gaussian g) {
    if (push.background_is_free == 0u) {
        g.background = (push.background - c.least) * c.scale + push.background_per_area * g.amplitude * g.width;
    }
    return g;
}

// Area, centroid and variance of the curve above its least value.
Gaussian moments(Curve c, float range) {
    vec3 sums = vec3(0.0);
    for (uint i = 0; i < push.step_count; i++) {
        float y = value(c, i);
        if (y >= c.saturation) continue;
        Step at = push.steps.at[i];
        float w = (y - c.least) * c.scale * at.width;
        sums += w * vec3(1.0, at.offset, at.offset * at.offset);
    }
    float centre = sums.y / sums.x;
    float variance = max(sums.z / sums.x - centre * centre, 0.0);
    float width = clamp(sqrt(variance), push.min_width, 0.5);
    return tied(c, Gaussian(range * c.scale, centre, width, 0.0));
}

// Slopes by amplitude, centre (in widths), logarithm of the width, background.
vec4 slopes(Gaussian g, float t, float e) {
    float ae = g.amplitude * e;
    if (push.background_is_free != 0u) return vec4(e, ae * t, ae * t * t, 1.0);
    float by_height = push.background_per_area * g.width;
    return vec4(e + by_height, ae * t, ae * t * t + by_height * g.amplitude, 0.0);
}

// Weight of a point whose expected value is f: one over its variance in counts, from the fit.
float weight(Curve c, Gaussian g, float f) {
    if (push.poisson == 0u) return 1.0;
    return 1.0 / max(f + c.least * c.scale, 1e-3 * abs(g.amplitude));
}

// A step of the unknowns, kept from leaping.
Gaussian moved(Curve c, Gaussian g, vec4 step) {
    g.amplitude += step.x;
    g.centre += g.width * clamp(step.y, -1.0, 1.0);
    g.width = clamp(g.width * exp(clamp(step.z, -0.7, 0.7)), 0.5 * push.min_width, 2.0 * push.max_width);
    g.background += step.w;
    return tied(c, g);
}

// Largest part of a step, in amplitudes and widths.
float size(Gaussian g, vec4 step) {
    vec4 parts = abs(step) / vec4(abs(g.amplitude), 1.0, 1.0, abs(g.amplitude));
    return max(max(parts.x, parts.y), max(parts.z, parts.w));
}
