// Random source offsets and evenly spaced targets: pure functions of (seed, view, row, column,
// sample), so that they do not depend on tiling or batches.

#include "random/hash.glsl"

struct Draw {
    vec2 source; // offset of the start point from the source centre, x and z, m
    vec2 target; // from the pixel's centre, x and z, m
    uint key;    // of what the ray draws in the sample; not 0
};

Draw draw(IlluminationParams light, Pixel pixel, uint view, uvec2 seed, uint ray, uvec2 rays) {
    uvec4 key = pcg4d(uvec4(seed, view, uint(pixel.row)));
    uvec4 bits = pcg4d(key ^ uvec4(uint(pixel.column), ray, 0u, 0u));
    vec2 gauss = normal_pair(bits.xy);
    uvec2 place = uvec2(ray % rays.x, ray / rays.x);
    vec2 target = (vec2(place) + 0.5) / vec2(rays) - 0.5;
    float pick = below_one(bits.z);
    uint k = 0u;
    while (pick >= SpotParts(light.spot_parts).at[k].below) k++;
    SpotPart part = SpotParts(light.spot_parts).at[k];
    return Draw(vec2(part.x, part.z) + gauss * vec2(part.deviation_x, part.deviation_z),
                vec2(target.x * light.column_pitch, -target.y * light.row_pitch),
                max(bits.w, 1u));
}
