// Rays between the voxels of a slice, for all projectors.

// A law that is linear in the slices.
float along(vec2 law, float slice) { return law.x + law.y * slice; }

// Share of the side of a voxel at `voxel` that a ray at `place` gets.
float share(float place, float voxel) { return max(0.0, 1.0 - abs(place - voxel)); }

// Whole numbers from `low` to `high`: the first, and one behind the last, from 0 to `count`. A little
// more than there are: coefficients decide.
ivec2 between(float low, float high, uint count) {
    float end = float(count);
    return ivec2(int(ceil(clamp(low - 1e-3, 0.0, end))),
                 int(floor(clamp(high + 1e-3, -1.0, end - 1.0))) + 1);
}
