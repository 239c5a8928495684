// Adds filtered projections to the voxels of a slab: one thread a voxel, views in order, linear
// interpolation between columns and rows.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/BackProjectPush.glsl"

// Value between two columns of a row.
float between(uint start, float column) {
    uint left = min(uint(column), push.columns - 1u);
    uint right = min(left + 1u, push.columns - 1u);
    float a = push.projections.at[start + left];
    return a + (column - float(left)) * (push.projections.at[start + right] - a);
}

void main() {
    uint voxel = push.first + gl_GlobalInvocationID.x;
    if (voxel >= push.end) return;
    uint slice = push.size_x * push.size_y;
    uint z = push.first_slice + voxel / slice;
    uint y = voxel % slice / push.size_x;
    uint x = voxel % push.size_x;
    vec3 p = push.origin + vec3(float(x), float(y), float(z)) * push.voxel;
    // Half a pixel beyond the outer centres still belongs to the detector.
    vec2 last = vec2(float(push.columns), float(push.rows)) - 1.0;
    float sum = push.volume.at[voxel];
    for (uint view = 0u; view < push.view_count; view++) {
        float cosine = push.views.at[view].cosine;
        float sine = push.views.at[view].sine;
        float across = p.x * cosine + p.y * sine + push.axis;
        float depth = p.y * cosine - p.x * sine;
        float near = 1.0 / (1.0 + depth * push.per_distance);
        vec2 at = vec2(across * near * push.column_scale + push.column_zero,
                       p.z * near * push.row_scale + push.row_zero);
        if (any(lessThan(at, vec2(-0.5))) || any(greaterThan(at, last + 0.5))) continue;
        at = clamp(at, vec2(0.0), last);
        uint row = uint(at.y);
        uint below = min(row + 1u, push.rows - 1u);
        uint start = view * push.rows;
        float value = between((start + row) * push.columns, at.x);
        float under = between((start + below) * push.columns, at.x);
        float share = at.y - float(row);
        float weight = push.is_squared != 0u ? near * near : near;
        value += share * (under - value);
        sum += value * weight;
    }
    push.volume.at[voxel] = sum;
}
