// Jarzynski and Olano 2020, "Hash functions for GPU rendering".
uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    v ^= v >> 16u;
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    return v;
}

// In (0, 1], and in [0, 1): multiples of 2^-24.
float above_zero(uint bits) {
    return (float(bits >> 8) + 1.0) / 16777216.0;
}

float below_one(uint bits) {
    return float(bits >> 8) / 16777216.0;
}

// Two numbers of the standard normal distribution.
vec2 normal_pair(uvec2 bits) {
    float angle = 6.2831853 * below_one(bits.y);
    return sqrt(-2.0 * log(above_zero(bits.x))) * vec2(cos(angle), sin(angle));
}
