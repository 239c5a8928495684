// Heights of rough surfaces: a Gaussian random field with the autocorrelation exp(-r^2/length^2), a function of
// seed, object and place in the sample (docs/waves.md, "Roughness").

// White noise on a cubic lattice, blurred by a Gaussian of half the length. Spacing over the length:
const float SPACING = 0.6;
// exp(-FALL d^2) is the Gaussian, d in spacings: (1/2) (2 SPACING)^2.
const float FALL = 0.72;
const float FALLS = 0.23692776; // exp(-2 FALL)
// One over the deviation of the sum, (sqrt(pi) / (2 SPACING))^(-3/2): the variance depends on the place by 0.2 %.
const float UNIT = 0.55707;
// Lattice points within three spacings, along an axis: the Gaussian is 0.0015 beyond.
const uint NEAR = 6u;

// A number of the even distribution of mean 0 and variance 1 (PCG-RXS-M-XS).
float even(uint bits) {
    bits = bits * 747796405u + 2891336453u;
    bits = ((bits >> ((bits >> 28u) + 4u)) ^ bits) * 277803737u;
    return float(int((bits >> 22u) ^ bits)) * 8.0654919e-10;
}

// Height of a surface outward of its mesh or shape at a place of the world, m.
float height_at(vec3 place, Surface surface) {
    vec3 at = place / (SPACING * surface.correlation);
    vec3 cell = floor(at);
    vec3 apart = at - cell + 2.0;
    ivec3 first = ivec3(cell) - 2;
    vec3 weight = exp(-FALL * apart * apart);
    // From a lattice point to the next one.
    vec3 ratio = exp(FALL * (2.0 * apart - 1.0));
    float sum = 0.0;
    vec2 z = vec2(weight.z, ratio.z);
    [[dont_unroll]] for (uint k = 0u; k < NEAR; k++) {
        vec2 y = vec2(weight.y, ratio.y);
        [[dont_unroll]] for (uint j = 0u; j < NEAR; j++) {
            uint row = pcg4d(uvec4(sample_.seed, surface.hash, 0u)
                             ^ uvec4(uint(first.y) + j, 0u, 0u, uint(first.z) + k)).x;
            vec2 x = vec2(weight.x, ratio.x);
            float line = 0.0;
            for (uint i = 0u; i < NEAR; i++) {
                line += x.x * even(row + uint(first.x) + i);
                x = vec2(x.x * x.y, x.y * FALLS);
            }
            sum += z.x * y.x * line;
            y = vec2(y.x * y.y, y.y * FALLS);
        }
        z = vec2(z.x * z.y, z.y * FALLS);
    }
    return 0.70710678 * surface.roughness * surface.correlation * UNIT * sum;
}
