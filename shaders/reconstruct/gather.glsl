// Voxels that a ray crosses.

// Slices, counted from 0, where a law lies between two values.
ivec2 slices_between(vec2 law, float low, float high, float middle, uint count) {
    float slope = abs(law.y) < 1e-9 ? 1e-9 : law.y;
    vec2 at = (vec2(low, high) + vec2(-1e-3, 1e-3) - law.x) / slope + middle;
    return between(min(at.x, at.y), max(at.x, at.y), count);
}

// Two neighbours on a line of voxels at a place, counted from the first: those beyond the line are 0.
float pair(uint start, uint stride, float place, uint count) {
    float left = floor(place);
    int voxel = int(left), last = int(count) - 1;
    float a = push.volume.at[start + uint(clamp(voxel, 0, last)) * stride];
    float b = push.volume.at[start + uint(clamp(voxel + 1, 0, last)) * stride];
    a = voxel >= 0 && voxel <= last ? a * share(place, left) : 0.0;
    b = voxel >= -1 && voxel < last ? b * share(place, left + 1.0) : 0.0;
    return a + b;
}
