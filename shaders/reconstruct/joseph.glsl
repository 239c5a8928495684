// Coefficients of Joseph's projector, the same for both directions: a ray crosses a slice of the volume
// between two voxels, and counts in each by one minus its distance in voxels.

#include "reconstruct/slices.glsl"

// A ray in the slices of its sheet: values in the middle slice, and changes from slice to slice.
struct Line {
    // Voxels from the middle of the slice.
    vec2 cross;
    // Distance from the source, as a share of the distance to the axis.
    vec2 scale;
    // Depth behind the axis, m.
    vec2 depth;
};

Line line_at(Sheet sheet, float place) {
    float per = 1.0 / (sheet.weight + sheet.weight_by_place * place);
    vec2 across = vec2(sheet.cross + sheet.cross_by_place * place,
                       sheet.cross_by_slice + sheet.cross_by_both * place);
    vec2 depth = vec2(sheet.depth + sheet.depth_by_place * place, sheet.depth_by_slice);
    return Line(across * per, vec2(sheet.scale, sheet.scale_by_slice) * per, depth * per);
}

// Weight of a voxel in the angle of a ray.
float arm(Line line, float slice) {
    if (push.arm == ARM_NONE) return 1.0;
    float lever = 1.0 - along(line.depth, slice) * push.per_lever;
    if (push.arm == ARM_SQUARED) return lever * lever - push.arm_less;
    return (lever - push.arm_less) / along(line.scale, slice);
}

#ifdef CONE
// Plane of the volume, counted from its first, at the height of a ray in a row.
vec2 height_of(Line line, uint row) {
    vec2 height = line.scale * (push.row_zero - push.row_step * float(row));
    return vec2(height.x - push.plane_zero, height.y);
}
#endif
