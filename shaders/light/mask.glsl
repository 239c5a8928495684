// Masks: transmission of the bars, and the hard-edged aperture that passes as much light as a
// thick one does (docs/physics.md, "Thick bars").

float secant(float slope_x, float slope_z) {
    return sqrt(1.0 + slope_x * slope_x + slope_z * slope_z);
}

float bar_transmission(Mask mask, float sec) {
    if (mask.averaged != 0u) return 0.0;
    return mask.attenuation > 0.0 ? exp(-mask.attenuation * sec) : mask.transmission;
}

// An aperture of some period.
struct Place {
    int period;
    uint aperture;
};

// The next one; counted, since CPU devices divide whole numbers one lane at a time.
Place next_place(Mask mask, Place place) {
    bool last = place.aperture + 1u >= mask.count;
    return Place(last ? place.period + 1 : place.period, last ? 0u : place.aperture + 1u);
}

// The aperture there; the only one of a period without a look at memory.
Aperture aperture_of(Mask mask, Place place) {
    if (mask.count == 1u) return Aperture(mask.first, mask.last);
    return mask.apertures.at[place.aperture];
}

// Share of the period that is open.
float open_part(Mask mask) {
    float open = 0.0;
    for (uint i = 0u; i < mask.count; i++) {
        open += mask.apertures.at[i].high - mask.apertures.at[i].low;
    }
    return open / mask.period;
}

// Width of the hard-edged aperture; `leak` is the transmission of the bars. For averaged masks that
// of an aperture without bars, which cells narrow by what they tell (`shaded_width`).
float effective_width(Mask mask, float width, float slope, float sec, float leak) {
    float shadow = mask.thickness * abs(slope);
    if (mask.averaged != 0u) return width;
    float a = mask.attenuation * sec;
    if (shadow <= 0.0 || a <= 0.0 || 1.0 - leak < 1e-5) return width;
    if (shadow <= width) {
        float mean = a < 1e-3 ? 1.0 - 0.5 * a : (1.0 - leak) / a;
        return width - shadow * (1.0 - 2.0 * (mean - leak) / (1.0 - leak));
    }
    // The two shadows overlap: no ray passes free.
    float least = exp(-a * (1.0 - width / shadow));
    float open = 2.0 * (shadow * (least - leak) / a - width * leak)
        + (shadow - width) * (least - leak);
    return open / (1.0 - leak);
}

// The same for a cell, from the width that all cells share.
float shaded_width(Mask mask, float width, float slope, float shade) {
    return mask.averaged != 0u ? width - mask.thickness * abs(slope) * shade : width;
}

// Variance of an edge that shadows soften, m2, beyond the hard edge above.
float edge_variance(Mask mask, float slope, float sec, float leak) {
    float shadow = mask.thickness * abs(slope);
    float a = mask.attenuation * sec;
    if (mask.present != 0u && mask.averaged != 0u) return shadow * shadow * mask.softness;
    if (mask.present == 0u || shadow <= 0.0 || a <= 0.0) return 0.0;
    if (a < 0.1) return shadow * shadow / 12.0; // the difference below would lose its digits
    float opaque = 1.0 - leak;
    return max(shadow * shadow * (1.0 / (a * a) - leak / (opaque * opaque)), 0.0);
}
