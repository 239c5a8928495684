// Integrals of a volume along rays by Joseph's method, where each view has a motion of its own: one
// thread a ray; planes of the volume in order, in each the slices in order.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/ProjectMovedPush.glsl"
#include "reconstruct/moved.glsl"
#include "reconstruct/gather.glsl"

void main() {
    uint number = push.first + gl_GlobalInvocationID.x;
    if (number >= push.end) return;
    uint column = number % push.columns;
    uint row = number / push.columns % push.rows;
    uint sheets = 3u * (number / (push.columns * push.rows));
    vec3 ray = vec3(1.0, push.places.at[column], float(row) - 0.5 * float(push.rows - 1u));
    uint axis = axis_of(push.sheets, sheets, ray);
    MovedLine line = line_at(push.sheets.at[sheets + axis], ray);

    uint area = push.size_x * push.size_y;
    uvec3 size = uvec3(push.size_x, push.size_y, push.size_z);
    vec3 middle = 0.5 * vec3(size - 1u);
    uint count = size[axis];
    float middle_slice = middle[axis];
    float sum = push.rays.at[number];
    if (axis == 2u) {
        int end = min(int(push.plane_end), int(count));
        for (int plane = int(push.first_plane); plane < end; plane++) {
            float at = float(plane) - middle_slice;
            float x = along(line.first, at) + middle.x;
            float y = along(line.second, at) + middle.y;
            if (x <= -1.0 || x >= float(size.x) || y <= -1.0 || y >= float(size.y)) continue;
            uint start = (uint(plane) - push.first_plane) * area;
            float low = floor(y);
            int line_of = int(low), last = int(size.y) - 1;
            float a = line_of >= 0 ? pair(start + uint(line_of) * size.x, 1u, x, size.x) : 0.0;
            float b = line_of < last ? pair(start + uint(line_of + 1) * size.x, 1u, x, size.x) : 0.0;
            sum += (a * share(y, low) + b * share(y, low + 1.0)) * arm(line, at);
        }
    } else {
        uint across = axis == 0u ? 1u : 0u;
        uint stride = axis == 0u ? size.x : 1u;
        uint slice_stride = axis == 0u ? 1u : size.x;
        float border = middle[across] + 1.0;
        ivec2 inside = slices_between(line.first, -border, border, middle_slice, count);
        vec2 height = vec2(line.second.x + middle.z, line.second.y);
        vec2 ends = vec2(along(height, float(inside.x) - middle_slice),
                         along(height, float(inside.y - 1) - middle_slice));
        ivec2 planes = between(min(ends.x, ends.y) - 1.0, max(ends.x, ends.y) + 1.0, push.plane_end);
        for (int plane = max(planes.x, int(push.first_plane)); plane < planes.y; plane++) {
            float place = float(plane);
            ivec2 slices = slices_between(height, place - 1.0, place + 1.0, middle_slice, count);
            slices = ivec2(max(slices.x, inside.x), min(slices.y, inside.y));
            uint start = (uint(plane) - push.first_plane) * area;
            for (int slice = slices.x; slice < slices.y; slice++) {
                float at = float(slice) - middle_slice;
                float cross = along(line.first, at) + middle[across];
                float value = pair(start + uint(slice) * slice_stride, stride, cross, size[across]);
                sum += value * share(along(height, at), place) * arm(line, at);
            }
        }
    }
    push.rays.at[number] = sum;
}
