// The exponential in twofold arithmetic.

// exp(-h), h >= 0, to about 1e-9 of one.
Twofold exp_minus(Twofold h) {
    float k = floor(h.high * 1.44269504 + 0.5);
    if (k > 120.0) return Twofold(0.0, 0.0);
    // ln 2 in parts, the first short enough for k times it to be exact.
    precise float f = h.high - k * 0.693359375;
    Twofold g = two_sum(-f, k * -2.12194440e-4);
    precise float low = g.low - h.low;
    // exp(g) - 1 of an eighth of it, doubled three times: E(2g) = E (2 + E).
    precise float x = g.high * 0.125;
    precise float tail = x * x * (0.5 + x * (1.66666667e-1 + x * (4.16666667e-2
        + x * (8.33333333e-3 + x * 1.38888889e-3))));
    Twofold e = two_sum(x, tail + low * 0.125);
    for (int i = 0; i < 3; i++) e = multiply(e, add(Twofold(2.0, 0.0), e));
    e = add(Twofold(1.0, 0.0), e);
    float scale = uintBitsToFloat(uint(127 - int(k)) << 23);
    return Twofold(e.high * scale, e.low * scale);
}
