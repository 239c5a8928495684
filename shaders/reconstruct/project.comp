// Integrals of a volume along rays by Joseph's method: one thread a ray; planes of the volume in order,
// in each the slices in order.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/ProjectPush.glsl"
#include "reconstruct/joseph.glsl"
#include "reconstruct/gather.glsl"

void main() {
    uint ray = push.first + gl_GlobalInvocationID.x;
    if (ray >= push.end) return;
    uint column = ray % push.columns;
    uint view = ray / (push.columns * push.rows);
    uint number = 2u * view;
    if (column >= push.sheets.at[number].end) number++;
    Sheet sheet = push.sheets.at[number];
    Line line = line_at(sheet, push.places.at[column]);

    bool is_x = sheet.is_x != 0u;
    uint size = is_x ? push.size_y : push.size_x;
    uint count = is_x ? push.size_x : push.size_y;
    uint stride = is_x ? push.size_x : 1u;
    uint slice_stride = is_x ? 1u : push.size_x;
    float middle = 0.5 * float(size - 1u);
    float middle_slice = 0.5 * float(count - 1u);
    ivec2 inside = slices_between(line.cross, -1.0 - middle, middle + 1.0, middle_slice, count);
    float sum = push.rays.at[ray];
#ifdef CONE
    vec2 height = height_of(line, ray / push.columns % push.rows);
    vec2 ends = vec2(along(height, float(inside.x) - middle_slice),
                     along(height, float(inside.y - 1) - middle_slice));
    ivec2 planes = between(min(ends.x, ends.y) - 1.0, max(ends.x, ends.y) + 1.0, push.plane_end);
    for (int plane = max(planes.x, int(push.first_plane)); plane < planes.y; plane++) {
        float place = float(plane);
        ivec2 slices = slices_between(height, place - 1.0, place + 1.0, middle_slice, count);
        slices = ivec2(max(slices.x, inside.x), min(slices.y, inside.y));
        uint start = (uint(plane) - push.first_plane) * push.size_x * push.size_y;
#else
        ivec2 slices = inside;
        uint start = 0u;
#endif
        for (int slice = slices.x; slice < slices.y; slice++) {
            float at = float(slice) - middle_slice;
            float cross = along(line.cross, at) + middle;
            float value = pair(start + uint(slice) * slice_stride, stride, cross, size);
#ifdef CONE
            sum += value * share(along(height, at), place) * arm(line, at);
        }
    }
#else
            sum += value * arm(line, at);
        }
#endif
    push.rays.at[ray] = sum;
}
