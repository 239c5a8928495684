// Random source offsets and evenly spaced targets: pure functions of (seed, view, row, column,
// sample), so that they do not depend on tiling or batches.

// Jarzynski and Olano 2020, "Hash functions for GPU rendering".
uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    v ^= v >> 16u;
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    return v;
}

struct Draw {
    vec2 source; // offset of the start point from the source centre, x and z, m
    vec2 target; // from the pixel's centre, x and z, m
};

Draw draw(IlluminationParams light, Pixel pixel, uint view, uvec2 seed, uint ray, uvec2 rays) {
    uvec4 key = pcg4d(uvec4(seed, view, uint(pixel.row)));
    uvec4 bits = pcg4d(key ^ uvec4(uint(pixel.column), ray, 0u, 0u));
    float u = (float(bits.x >> 8) + 1.0) / 16777216.0;
    float angle = 6.2831853 * (float(bits.y >> 8) / 16777216.0);
    float radius = sqrt(-2.0 * log(u));
    vec2 gauss = radius * vec2(cos(angle), sin(angle));
    uvec2 place = uvec2(ray % rays.x, ray / rays.x);
    vec2 target = (vec2(place) + 0.5) / vec2(rays) - 0.5;
    float pick = float(bits.z >> 8) / 16777216.0;
    uint k = 0u;
    while (pick >= SpotParts(light.spot_parts).at[k].below) k++;
    SpotPart part = SpotParts(light.spot_parts).at[k];
    return Draw(vec2(part.x, part.z) + gauss * vec2(part.deviation_x, part.deviation_z),
                vec2(target.x * light.column_pitch, -target.y * light.row_pitch));
}
