// Results of the rays at the ends of cells at some energies: first order by their moments, and what exact transport
// finds beyond it (docs/developers/numerics.md, "Cells of all energies").
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/EnergiesPush.glsl"

// Optical depth of rays that could not be followed.
const float DARK = 1e4;

EnergyParams params;
uint cell;

// Results of a ray at four energies: optical depth, displacement along x at the analyser and along z at the detector,
// change of slope along x.
struct Results {
    vec4 depth;
    vec4 x;
    vec4 z;
    vec4 slope_x;
};

// A value of the constants at four energies.
vec4 constant(uvec4 energies, uint at) {
    uvec4 places = params.variances + energies * (1u + 2u * params.materials + params.variances) + at;
    Floats all = Floats(params.constants);
    return vec4(all.at[places.x], all.at[places.y], all.at[places.z], all.at[places.w]);
}

void add_material(inout Results results, uint at, vec4 mu, vec4 delta) {
    results.depth += mu * push.moments.at[at + MOMENTS_PATH];
    results.x += delta * push.moments.at[at + MOMENTS_LEVER];
    results.z += delta
        * (push.moments.at[at + MOMENTS_LEVER + 1u] + push.moments.at[at + MOMENTS_SLOPE + 1u] * params.gap);
    results.slope_x += delta * push.moments.at[at + MOMENTS_SLOPE];
}

// First order of the rays at both ends of the cell.
void first_order(uvec4 energies, out Results low, out Results high) {
    low = Results(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
    high = low;
    uint at = 2u * cell * params.moment_words;
    uint materials = push.has_moments != 0u ? params.materials : 0u;
    for (uint m = 0u; m < materials; m++) {
        vec4 mu = constant(energies, 1u + 2u * m);
        vec4 delta = constant(energies, 2u + 2u * m);
        if (mu != vec4(0.0) || delta != vec4(0.0)) {
            add_material(low, at, mu, delta);
            add_material(high, at + params.moment_words, mu, delta);
        }
        at += MOMENTS_PER_MATERIAL;
    }
}

// A result of exact transport, at all four energies.
Results exact_results(uint ray) {
    RayResult found = push.rays.at[ray];
    if ((found.flags & FLAG_NOT_FINITE) != 0u) return Results(vec4(DARK), vec4(0.0), vec4(0.0), vec4(0.0));
    return Results(vec4(found.optical_depth), vec4(found.displacement_x),
                   vec4(found.displacement_z + found.slope_z * params.gap), vec4(found.slope_x));
}

// Adds what exact transport at the mean constants finds beyond the first order there, which is of second order: it
// grows with the square of delta. `refraction`: relative to these constants.
void correct(inout Results results, uint ray, Results first, vec4 refraction) {
    Results exact = exact_results(ray);
    // A path that changes by refraction: linear in delta, and in mu.
    if (first.depth.x > 0.0) results.depth += (exact.depth - first.depth) * refraction * results.depth / first.depth;
    if ((push.rays.at[ray & ~1u].flags & FLAG_DRAWN) != 0u) {
        // Drawn normals bend in proportion.
        results = Results(results.depth, exact.x * refraction, exact.z * refraction, exact.slope_x * refraction);
    } else {
        results.x += (exact.x - first.x) * refraction * refraction;
    }
}

// Replaces results of an energy by exact transport in the middle of the cell, with their change from end to end.
void repeat(inout Results low, inout Results high, uint ray, int of) {
    Results middle = exact_results(ray);
    float depth = 0.5 * (high.depth[of] - low.depth[of]);
    float x = 0.5 * (high.x[of] - low.x[of]);
    low.depth[of] = max(middle.depth.x - depth, 0.0);
    high.depth[of] = max(middle.depth.x + depth, 0.0);
    low.x[of] = middle.x.x - x;
    high.x[of] = middle.x.x + x;
    low.z[of] = high.z[of] = middle.z.x;
    low.slope_x[of] = high.slope_x[of] = middle.slope_x.x;
}

// Behind apertures that end along z light of a cell lands in the middle of its landings over its height, its ray beside it
// by this much at the mean constants.
float from_ray(uint exact) {
    Results low, high;
    if (exact != 0u) {
        low = exact_results(2u * (exact - 1u));
        high = exact_results(2u * (exact - 1u) + 1u);
    } else {
        first_order(uvec4(params.energies), low, high);
    }
    return push.cells.at[cell].displacement_z - 0.5 * (low.z.x + high.z.x);
}

// Variance of the displacement: by rough surfaces, where that of each pair of materials grows with the step, and by
// materials that scatter.
vec4 variances(uvec4 energies) {
    vec4 sum = vec4(0.0);
    for (uint k = 0u; k < params.variances && push.has_moments != 0u; k++) {
        uint at = 2u * cell * params.moment_words + uint(Floats(params.constants).at[k]);
        float moment = 0.5 * (push.moments.at[at] + push.moments.at[at + params.moment_words]);
        sum += moment * constant(energies, 1u + 2u * params.materials + k);
    }
    return max(sum, vec4(0.0));
}

void main() {
    cell = gl_GlobalInvocationID.x;
    if (cell >= push.cell_count) return;
    params = push.params.at[0];
    uint first = ENERGIES_EACH * gl_GlobalInvocationID.y;
    uint count = min(params.energies - first, ENERGIES_EACH);
    uvec4 energies = first + min(uvec4(0u, 1u, 2u, 3u), uvec4(count - 1u));
    Results low, high;
    first_order(energies, low, high);
    vec4 refraction = constant(energies, 0u);
    uint exact = push.exact.at[cell];
    if (exact != 0u) {
        Results mean_low, mean_high;
        first_order(uvec4(params.energies), mean_low, mean_high);
        correct(low, 2u * (exact - 1u), mean_low, refraction);
        correct(high, 2u * (exact - 1u) + 1u, mean_high, refraction);
        for (uint n = 0u; n < count; n++) {
            uint ray = push.repeated.at[(exact - 1u) * params.energies + first + n];
            if (ray != 0u) repeat(low, high, ray, int(n));
        }
    }
    vec4 light = exp(-0.5 * (low.depth + high.depth));
    vec4 z = 0.5 * (low.z + high.z);
    if (params.heights != 0u) z += from_ray(exact) * refraction;
    vec4 slope_x = 0.5 * (low.slope_x + high.slope_x);
    vec4 variance = push.cells.at[cell].displacement_variance * refraction * refraction + variances(energies);
    for (uint n = 0u; n < count; n++) {
        push.results.at[cell * params.energies + first + n] = EnergyResult(
            low.depth[n], high.depth[n], light[n], low.x[n], high.x[n], z[n], slope_x[n], variance[n]);
    }
}
