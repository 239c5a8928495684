// Random source offsets and spread targets: pure functions of (seed, pose, row, column, sample), so
// that they do not depend on tiling or batches.

#include "random/hash.glsl"

struct Draw {
    vec2 source; // offset of the start point from the source centre, x and z, m
    vec2 target; // from the pixel's centre, x and z, m
    uint key;    // of what the ray draws in the sample; not 0
};

// Fractional part of the square root of 2: its multiples fill [0, 1) evenly.
const uint STRIDE = 1779033703u;

// Target of a ray, share of the pixel from its centre, along x and down. Targets of a grid are evenly
// spaced; others are so along x, and along z as multiples of STRIDE that each pixel shifts.
vec2 target_of(uvec4 key, uint column, uint ray, uvec2 rays) {
    if (rays.y != 0u) {
        return (vec2(uvec2(ray % rays.x, ray / rays.x)) + 0.5) / vec2(rays) - 0.5;
    }
    uint shift = pcg4d(key ^ uvec4(column, 0u, 1u, 0u)).x;
    float down = (float((shift + ray * STRIDE) >> 8u) + 0.5) / 16777216.0;
    return vec2((float(ray) + 0.5) / float(rays.x), down) - 0.5;
}

Draw draw(IlluminationParams light, Pixel pixel, uint pose, uvec2 seed, uint ray, uvec2 rays) {
    uvec4 key = pcg4d(uvec4(seed, pose, uint(pixel.row)));
    uvec4 bits = pcg4d(key ^ uvec4(uint(pixel.column), ray, 0u, 0u));
    vec2 gauss = normal_pair(bits.xy);
    vec2 target = target_of(key, uint(pixel.column), ray, rays);
    float pick = below_one(bits.z);
    uint k = 0u;
    while (pick >= SpotParts(light.spot_parts).at[k].below) k++;
    SpotPart part = SpotParts(light.spot_parts).at[k];
    return Draw(vec2(part.x, part.z) + gauss * vec2(part.deviation_x, part.deviation_z),
                vec2(target.x * light.column_pitch, -target.y * light.row_pitch),
                max(bits.w, 1u));
}
