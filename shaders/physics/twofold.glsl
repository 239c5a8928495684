// Twofold arithmetic: a number as the unevaluated sum of two f32 (Dekker, Knuth), some 14 digits.
// `precise` keeps a compiler from simplifying it away. Residuals, of a fit or of a place on a
// surface, are small differences of large numbers: plain f32 would stop a thousand times short.

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

// Three numbers at once.
struct Twofold3 {
    vec3 high;
    vec3 low;
};

Twofold3 two_sum(vec3 a, vec3 b) {
    precise vec3 s = a + b;
    precise vec3 t = s - a;
    precise vec3 e = (a - (s - t)) + (b - t);
    return Twofold3(s, e);
}

Twofold3 two_product(vec3 a, vec3 b) {
    precise vec3 ca = 4097.0 * a;
    precise vec3 ah = ca - (ca - a);
    precise vec3 al = a - ah;
    precise vec3 cb = 4097.0 * b;
    precise vec3 bh = cb - (cb - b);
    precise vec3 bl = b - bh;
    precise vec3 p = a * b;
    precise vec3 e = ((ah * bh - p) + ah * bl + al * bh) + al * bl;
    return Twofold3(p, e);
}

Twofold3 add(Twofold3 a, Twofold3 b) {
    Twofold3 s = two_sum(a.high, b.high);
    precise vec3 low = s.low + (a.low + b.low);
    return two_sum(s.high, low);
}

Twofold3 multiply(Twofold3 a, Twofold3 b) {
    Twofold3 p = two_product(a.high, b.high);
    precise vec3 low = p.low + (a.high * b.low + a.low * b.high);
    return two_sum(p.high, low);
}


Twofold twofold_x(Twofold3 v) {
    return Twofold(v.high.x, v.low.x);
}

Twofold twofold_y(Twofold3 v) {
    return Twofold(v.high.y, v.low.y);
}

Twofold twofold_z(Twofold3 v) {
    return Twofold(v.high.z, v.low.z);
}
