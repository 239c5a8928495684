// Coefficients of Joseph's projector for views with motions of their own, the same for both directions.
// A ray is (1, place, row).

#include "reconstruct/slices.glsl"

// A ray in the slices across its axis: values in the middle slice, and changes from slice to slice.
struct MovedLine {
    // Voxels from the middle of the slice, along the first and the second of the other axes.
    vec2 first;
    vec2 second;
    // Depth behind the rotation centre, m.
    vec2 depth;
};

float linear(vec3 law, vec3 ray) { return law.x + law.y * ray.y + law.z * ray.z; }

// Axis that a ray of a view runs along: the one with most slices per depth. Both directions have to
// find the same, whatever a compiler does to sums.
uint axis_of(MovedSheets sheets, uint number, vec3 ray) {
    precise float speeds[3];
    for (uint axis = 0u; axis < 3u; axis++) {
        vec3 law = sheets.at[number + axis].weight;
        precise float by_place = law.y * ray.y;
        precise float by_row = law.z * ray.z;
        precise float part = law.x + by_place;
        speeds[axis] = abs(part + by_row);
    }
    if (speeds[0] >= speeds[1] && speeds[0] >= speeds[2]) return 0u;
    return speeds[1] >= speeds[2] ? 1u : 2u;
}

MovedLine line_at(MovedSheet sheet, vec3 ray) {
    float per = 1.0 / linear(sheet.weight, ray);
    vec2 first = vec2(linear(sheet.first, ray), linear(sheet.first_by_slice, ray));
    vec2 second = vec2(linear(sheet.second, ray), linear(sheet.second_by_slice, ray));
    vec2 depth = vec2(linear(sheet.depth, ray), sheet.depth_by_slice);
    return MovedLine(first * per, second * per, depth * per);
}

// Factor by which a voxel counts for what it does to the angle of a ray there.
float arm(MovedLine line, float slice) {
    if (push.arm == ARM_NONE) return 1.0;
    float depth = along(line.depth, slice);
    float lever = 1.0 - depth * push.per_lever;
    if (push.arm == ARM_SQUARED) return lever * lever - push.arm_less;
    return (lever - push.arm_less) / (1.0 + depth * push.per_distance);
}

// The other two axes.
uvec2 others(uint axis) { return uvec2(axis == 0u ? 1u : 0u, axis == 2u ? 1u : 2u); }
