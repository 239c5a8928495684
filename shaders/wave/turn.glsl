// Rotations by cycles. Drivers may err by 2^-11 in sine and cosine; these polynomials are within 2e-7.

// (cos, sin) of 2 pi cycles.
vec2 turned(float cycles) {
    float quarters = floor(4.0 * cycles + 0.5);
    float t = 6.283185307179586 * (cycles - 0.25 * quarters);
    float t2 = t * t;
    // Taylor series on |t| <= pi/4: the terms left out are below 4e-9 and 3e-8.
    float sine = t * (1.0 + t2 * (-1.6666667e-1 + t2 * (8.3333333e-3 + t2 * (-1.9841270e-4
        + t2 * 2.7557319e-6))));
    float cosine = 1.0 + t2 * (-0.5 + t2 * (4.1666667e-2 + t2 * (-1.3888889e-3 + t2 * 2.4801587e-5)));
    int quadrant = int(quarters) & 3;
    vec2 r = (quadrant & 1) == 0 ? vec2(cosine, sine) : vec2(-sine, cosine);
    return quadrant >= 2 ? -r : r;
}

// a b.
vec2 times(vec2 a, vec2 b) {
    return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

// a times the conjugate of b.
vec2 times_conjugate(vec2 a, vec2 b) {
    return vec2(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y);
}
