// Masks: transmission of the bars, and the hard-edged aperture that passes as much light as a
// thick one does (docs/physics.md, "Thick bars").

float secant(float slope_x, float slope_z) {
    return sqrt(1.0 + slope_x * slope_x + slope_z * slope_z);
}

float bar_transmission(Mask mask, float sec) {
    if (mask.averaged != 0u) return 0.0;
    return mask.attenuation > 0.0 ? exp(-mask.attenuation * sec) : mask.transmission;
}

// An aperture of the period; the only one without a look at memory.
Aperture aperture_of(Mask mask, int n) {
    if (mask.count == 1u) return Aperture(mask.first, mask.last);
    return mask.apertures.at[n % int(mask.count)];
}

// Share of the period that is open.
float open_part(Mask mask) {
    float open = 0.0;
    for (uint i = 0u; i < mask.count; i++) {
        open += mask.apertures.at[i].high - mask.apertures.at[i].low;
    }
    return open / mask.period;
}

// Width of the hard-edged aperture; `leak` is the transmission of the bars, `shade` that of the
// cell for averaged masks.
float effective_width(Mask mask, float width, float slope, float sec, float leak, float shade) {
    float shadow = mask.thickness * abs(slope);
    if (mask.averaged != 0u) return width - shadow * shade;
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
