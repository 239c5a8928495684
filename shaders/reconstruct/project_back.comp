// The transpose of project.comp: one thread a voxel gathers from the rays that count it, views, columns
// and rows in order.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/ProjectBackPush.glsl"
#include "reconstruct/joseph.glsl"

// Columns from a place on, counted in mean distances from the first: one that may be the first of them.
int column_from(float place) {
    if (push.is_even != 0u) return int(ceil(clamp(place - 1e-3, 0.0, float(push.columns))));
    uint bin = uint(clamp(place - 1e-3, 0.0, float(push.columns - 1u)));
    return int(push.starts.at[bin]);
}

void main() {
    uint number = push.first + gl_GlobalInvocationID.x;
    if (number >= push.end) return;
    uint area = push.size_x * push.size_y;
    uint x = number % push.size_x;
    uint y = number % area / push.size_x;
    vec2 middle = 0.5 * vec2(float(push.size_x - 1u), float(push.size_y - 1u));
    vec2 voxel = vec2(float(x), float(y)) - middle;
    float last = float(push.columns - 1u);
#ifdef CONE
    float plane = float(push.first_plane + number / area);
#endif
    float sum = push.volume.at[number];
    for (uint half_view = 0u; half_view < 2u * push.view_count; half_view++) {
        Sheet sheet = push.sheets.at[half_view];
        if (sheet.begin >= sheet.end) continue;
        float slice = sheet.is_x != 0u ? voxel.x : voxel.y;
        float cross = sheet.is_x != 0u ? voxel.y : voxel.x;
        // Places of the rays that cross the slice a voxel to either side.
        vec2 sides = vec2(cross - 1.0, cross + 1.0);
        vec2 places = (sides * sheet.weight - (sheet.cross + sheet.cross_by_slice * slice))
            / (sheet.cross_by_place + sheet.cross_by_both * slice - sides * sheet.weight_by_place);
        places += 0.5 * last;
        float high = max(places.x, places.y) + 1e-3;
        int column = max(column_from(min(places.x, places.y)), int(sheet.begin));
        uint start = (half_view >> 1) * push.rows * push.columns;
        for (; column < int(sheet.end); column++) {
            float place = float(column) - 0.5 * last;
            if (push.is_even == 0u) place = push.places.at[column];
            if (place + 0.5 * last > high) break;
            Line line = line_at(sheet, place);
            float weight = share(along(line.cross, slice), cross) * arm(line, slice);
#ifdef CONE
            float near = along(line.scale, slice) * push.row_step;
            float first_row = push.row_zero / push.row_step;
            vec2 rows = first_row - (vec2(plane + 1.0, plane - 1.0) + push.plane_zero) / near;
            ivec2 range = between(rows.x, rows.y, push.rows);
            for (int row = range.x; row < range.y; row++) {
                float height = along(height_of(line, uint(row)), slice);
                float value = push.rays.at[start + uint(row) * push.columns + uint(column)];
                sum += weight * share(height, plane) * value;
            }
#else
            sum += weight * push.rays.at[start + uint(column)];
#endif
        }
    }
    push.volume.at[number] = sum;
}
