// Results of the rays at the ends of cells at each energy: first order by their moments, and what exact transport
// finds beyond it (docs/developers/numerics.md, "Cells of all energies").
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/EnergiesPush.glsl"

// Optical depth of rays that could not be followed.
const float DARK = 1e4;

EnergyParams params;

// A value of the constants at an energy.
float constant(uint energy, uint at) {
    uint stride = 1u + 2u * params.materials + params.variances;
    return Floats(params.constants).at[params.variances + energy * stride + at];
}

// A result: optical depth, displacement along x at the analyser and along z at the detector, change of slope along x.

// First order of a ray at an energy.
vec4 first_order(uint ray, uint energy) {
    vec4 result = vec4(0.0);
    uint at = ray * params.moment_words;
    for (uint m = 0u; m < params.materials; m++) {
        float mu = constant(energy, 1u + 2u * m);
        float delta = constant(energy, 2u + 2u * m);
        if (mu != 0.0 || delta != 0.0) {
            float lever_z = push.moments.at[at + MOMENTS_LEVER + 1u] + push.moments.at[at + MOMENTS_SLOPE + 1u] * params.gap;
            result += vec4(mu * push.moments.at[at + MOMENTS_PATH], delta * push.moments.at[at + MOMENTS_LEVER],
                           delta * lever_z, delta * push.moments.at[at + MOMENTS_SLOPE]);
        }
        at += MOMENTS_PER_MATERIAL;
    }
    return result;
}

vec4 exact_result(uint ray) {
    RayResult found = push.rays.at[ray];
    if ((found.flags & FLAG_NOT_FINITE) != 0u) return vec4(DARK, 0.0, 0.0, 0.0);
    return vec4(found.optical_depth, found.displacement_x, found.displacement_z + found.slope_z * params.gap,
                found.slope_x);
}

// First order at an energy with what exact transport at the mean constants finds beyond it, which is of second order:
// it grows with the square of delta.
vec4 corrected(vec4 result, vec4 exact, vec4 first, float refraction, bool drawn) {
    // A path that changes by refraction: linear in delta, and in mu.
    if (first.x > 0.0) result.x += (exact.x - first.x) * refraction * result.x / first.x;
    // Drawn normals bend in proportion.
    if (drawn) return vec4(result.x, exact.yzw * refraction);
    result.y += (exact.y - first.y) * refraction * refraction;
    return result;
}

// Variance of the displacement: by rough surfaces, where that of each pair of materials grows with the step, and by
// materials that scatter.
float variance_of(uint cell, uint energy) {
    float variance = 0.0;
    for (uint k = 0u; k < params.variances; k++) {
        uint word = uint(Floats(params.constants).at[k]);
        float low = push.moments.at[2u * cell * params.moment_words + word];
        float high = push.moments.at[(2u * cell + 1u) * params.moment_words + word];
        variance += 0.5 * (low + high) * constant(energy, 1u + 2u * params.materials + k);
    }
    return max(variance, 0.0);
}

void main() {
    uint cell = gl_GlobalInvocationID.x;
    uint energy = gl_GlobalInvocationID.y;
    if (cell >= push.cell_count) return;
    params = push.params.at[0];
    vec4 low = first_order(2u * cell, energy);
    vec4 high = first_order(2u * cell + 1u, energy);
    float refraction = constant(energy, 0u);
    uint exact = push.exact.at[cell];
    if (exact != 0u) {
        uint ray = 2u * (exact - 1u);
        bool drawn = (push.rays.at[ray].flags & FLAG_DRAWN) != 0u;
        uint mean = params.energies;
        low = corrected(low, exact_result(ray), first_order(2u * cell, mean), refraction, drawn);
        high = corrected(high, exact_result(ray + 1u), first_order(2u * cell + 1u, mean), refraction, drawn);
        uint repeated = push.repeated.at[(exact - 1u) * params.energies + energy];
        if (repeated != 0u) {
            // In the middle of the cell, with the change of depth and displacement from end to end.
            vec4 middle = exact_result(repeated);
            vec2 change = 0.5 * (high.xy - low.xy);
            low = vec4(max(middle.x - change.x, 0.0), middle.y - change.y, middle.zw);
            high = vec4(max(middle.x + change.x, 0.0), middle.y + change.y, middle.zw);
        }
    }
    vec4 mean = 0.5 * (low + high);
    float variance = push.cells.at[cell].displacement_variance * refraction * refraction;
    push.results.at[cell * params.energies + energy] =
        EnergyResult(low.x, high.x, low.y, high.y, mean.z, mean.w, variance + variance_of(cell, energy));
}
