// The transpose of project_moved.comp: one thread a voxel gathers from the rays that count it; views,
// axes, columns and rows in order.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/ProjectBackMovedPush.glsl"
#include "reconstruct/moved.glsl"

// Columns from a place on, counted in mean distances from the first: one that may be the first of them.
int column_from(float place) {
    uint bin = uint(clamp(place - 1e-3, 0.0, float(push.columns - 1u)));
    return int(push.starts.at[bin]);
}

void main() {
    uint number = push.first + gl_GlobalInvocationID.x;
    if (number >= push.end) return;
    uint area = push.size_x * push.size_y;
    uvec3 size = uvec3(push.size_x, push.size_y, push.size_z);
    uvec3 at = uvec3(number % push.size_x, number % area / push.size_x, push.first_plane + number / area);
    vec3 voxel = vec3(at) - 0.5 * vec3(size - 1u);
    vec2 middle = 0.5 * vec2(float(push.columns - 1u), float(push.rows - 1u));
    float sum = push.volume.at[number];
    for (uint view = 0u; view < push.view_count; view++) {
        MovedView seen = push.views.at[view];
        for (uint axis = 0u; axis < 3u; axis++) {
            MovedSheet sheet = push.sheets.at[3u * view + axis];
            if (sheet.is_used == 0u) continue;
            uvec2 other = others(axis);
            // What rays within a voxel of it in its slice see lies in this rectangle of the detector.
            vec2 low = vec2(1e30), high = vec2(-1e30);
            for (uint corner = 0u; corner < 4u; corner++) {
                vec4 point = vec4(voxel, 1.0);
                point[other.x] += (corner & 1u) == 0u ? -1.0 : 1.0;
                point[other.y] += (corner & 2u) == 0u ? -1.0 : 1.0;
                vec2 seen_at = vec2(dot(seen.place, point), dot(seen.row, point));
                vec2 place = seen_at / dot(seen.scale, point) + middle;
                low = min(low, place);
                high = max(high, place);
            }
            ivec2 rows = between(low.y, high.y, push.rows);
            if (rows.x >= rows.y || low.x > float(push.columns) || high.x < -1.0) continue;
            float slice = voxel[axis];
            vec2 own = vec2(voxel[other.x], voxel[other.y]);
            for (int column = column_from(low.x); column < int(push.columns); column++) {
                float place = push.places.at[column];
                if (place + middle.x > high.x + 1e-3) break;
                for (int row = rows.x; row < rows.y; row++) {
                    vec3 ray = vec3(1.0, place, float(row) - middle.y);
                    if (axis_of(push.sheets, 3u * view, ray) != axis) continue;
                    MovedLine line = line_at(sheet, ray);
                    float weight = share(along(line.first, slice), own.x)
                        * share(along(line.second, slice), own.y);
                    if (weight <= 0.0) continue;
                    uint from = (view * push.rows + uint(row)) * push.columns + uint(column);
                    sum += weight * arm(line, slice) * push.rays.at[from];
                }
            }
        }
    }
    push.volume.at[number] = sum;
}
