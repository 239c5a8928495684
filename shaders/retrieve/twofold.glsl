// Twofold arithmetic: a number as the unevaluated sum of two f32 (Dekker, Knuth). `precise` keeps
// a compiler from simplifying it away. A fit's residual is a small difference of large numbers;
// in plain f32 it would stop a thousand times short of the f64 optimum.

struct Twofold {
    float high;
    float low;
};

Twofold two_sum(float a, float b) {
    precise float s = a + b;
    precise float t = s - a;
    precise float e = (a - (s - t)) + (b - t);
    return Twofold(s, e);
}

Twofold two_product(float a, float b) {
    // Veltkamp's split: a fused multiply-add is not fused on every device.
    precise float ca = 4097.0 * a;
    precise float ah = ca - (ca - a);
    precise float al = a - ah;
    precise float cb = 4097.0 * b;
    precise float bh = cb - (cb - b);
    precise float bl = b - bh;
    precise float p = a * b;
    precise float e = ((ah * bh - p) + ah * bl + al * bh) + al * bl;
    return Twofold(p, e);
}

Twofold add(Twofold a, Twofold b) {
    Twofold s = two_sum(a.high, b.high);
    precise float low = s.low + (a.low + b.low);
    return two_sum(s.high, low);
}

Twofold multiply(Twofold a, Twofold b) {
    Twofold p = two_product(a.high, b.high);
    precise float low = p.low + (a.high * b.low + a.low * b.high);
    return two_sum(p.high, low);
}

// One correction of the quotient in f32 gives all the digits there are.
Twofold divide(Twofold a, float b) {
    precise float q = a.high / b;
    Twofold p = two_product(q, b);
    precise float rest = ((a.high - p.high) - p.low) + a.low;
    precise float low = rest / b;
    return two_sum(q, low);
}

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
