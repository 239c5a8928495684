// Light of random rays: one invocation per share of the rays of a pixel in a batch, and some mask steps.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/RandomLightPush.glsl"

#include "random/draw.glsl"
#include "light/sum.glsl"
#include "physics/gauss.glsl"
#include "light/mask.glsl"
#ifdef HEIGHTS
#include "light/random_heights.glsl"
#endif

// Share of [low, high] that lies in apertures; `shift`: of the lattice.
float open_share(Mask mask, float low, float high, float shift) {
    float open = 0.0;
    int from = int(floor((low - shift) / mask.period - 0.5));
    int to = int(ceil((high - shift) / mask.period + 0.5));
    for (int k = from; k <= to; k++) {
        uint first = mask.count == 1u ? 0u : aperture_beyond(mask, low - shift - float(k) * mask.period);
        for (uint i = first; i < mask.count; i++) {
            Aperture aperture = aperture_of(mask, Place(k, i));
            float a = float(k) * mask.period + shift + aperture.low;
            float b = float(k) * mask.period + shift + aperture.high;
            if (a > high) break;
            if (high > low) open += max(min(b, high) - max(a, low), 0.0);
            else if (low > a && low < b) return 1.0;
        }
    }
    return high > low ? open / (high - low) : 0.0;
}

#ifdef WALLS
#include "light/random_walls.glsl"
#else
// Transmission of the exact path through bars and substrate.
float mask_transmission(Mask mask, float x, float shift, float slope, float sec) {
    if (mask.present == 0u) return 1.0;
    float plate = through_substrate(mask, sec);
    float half_shadow = 0.5 * mask.thickness * abs(slope);
    float open = open_share(mask, x - half_shadow, x + half_shadow, shift);
    if (mask.attenuation > 0.0) return plate * exp(-mask.attenuation * sec * (1.0 - open));
    return open > 0.5 ? plate : plate * mask.transmission;
}
#endif

// Threshold of a ray for rounding: multiples of the golden ratio fill [0, 1) evenly, so that equal
// terms are rounded up as often as they should be, whatever the batches are.
float rounding_threshold(uint ray) {
    return float((ray * 2654435769u) >> 8u) / 16777216.0;
}

// Dimension of the draws of scattered light.
const uint SCATTERED = 0x5ca77e2u;

void main() {
    uint p = gl_GlobalInvocationID.x / push.shares;
    uint share = gl_GlobalInvocationID.x % push.shares;
    uint first_step = push.first_step + gl_GlobalInvocationID.y * RANDOM_STEPS;
    if (p >= push.pixel_count || first_step >= push.steps) return;
    uint steps = min(push.steps - first_step, RANDOM_STEPS);
    IlluminationParams light = push.light_ref.at[0];
    Pixel pixel = push.pixels.at[p];
    BeamletGeometry beamlet = BeamletTable(light.beamlets).at[pixel.table];
    float one = light.spectral_weight / (float(push.rays_per_pixel.x) * float(max(push.rays_per_pixel.y, 1u)));
#ifdef HEIGHTS
    HeightParams heights = HeightParamsRef(light.heights).at[0];
    RowGeometry row_geometry = RowTable(heights.rows).at[pixel.row - heights.first_row];
#endif
    float row_z = (float(pixel.row) + 0.5 - light.middle_row) * light.row_slope;
    float plane = light.cell_plane / light.detector;
    float gap = light.detector - light.analyser;
    uint frame = light.row_count * light.column_count;
    // Sums of the light that stays in the pixel, by steps.
    uvec2 own[RANDOM_STEPS];
    for (uint k = 0u; k < RANDOM_STEPS; k++) own[k] = uvec2(0u);
    // Neighbours read neighbouring results.
    for (uint r = share; r < push.batch; r += push.shares) {
        Draw d = draw(light, pixel, push.pose, push.seed, push.first_ray + r, push.rays_per_pixel);
        RayResult result = RayResult(0.0, 0.0, 0.0, 0.0, 0.0, 0u, 0u, 0u, 0.0, 0.0, 0.0);
        if (push.empty == 0u) result = push.results.at[p * push.batch + r];
        if ((result.flags & FLAG_NOT_FINITE) != 0u) continue;
        float slope = beamlet.slope + (d.target.x - d.source.x) / light.detector;
        float slope_z = row_z + (d.target.y - d.source.y) / light.detector;
        float sec = secant(slope, slope_z);
        float x = d.source.x * (1.0 - plane) + d.target.x * plane;
        // What materials spread; rough surfaces have drawn their normals.
        vec2 scattered = vec2(0.0);
        if (result.displacement_variance > 0.0 || result.variance_z > 0.0) {
            vec2 normals = normal_pair(pcg4d(uvec4(d.key, SCATTERED, 0u, 0u)).xy);
            float spread_x = sqrt(result.displacement_variance);
            float joint = spread_x > 0.0 ? result.covariance / spread_x : 0.0;
            float own = sqrt(max(result.variance_z - joint * joint, 0.0));
            scattered = vec2(spread_x * normals.x, joint * normals.x + own * normals.y);
        }
        result.displacement_x += scattered.x;
        result.displacement_z += scattered.y;
        float u = d.source.x * (1.0 - light.ratio) + d.target.x * light.ratio + result.displacement_x;
#ifdef HEIGHTS
        // Rows downwards, from the upper end of the row of the pixel, and the slope along them.
        vec2 slopes = vec2(slope, -slope_z);
        float target_row = 0.5 - d.target.y / light.row_pitch;
        float at_mask = target_row - d.source.y * (1.0 - plane) / (plane * light.row_pitch);
        float at_analyser = target_row - (d.source.y * (1.0 - light.ratio) + result.displacement_z)
            / (light.ratio * light.row_pitch);
        float behind = heights.detector_mask.count == 0u
            ? mask_transmission(light.detector_mask, u, -beamlet.aperture_offset, slope, sec)
            : transmission_of_path(light.detector_mask, heights.detector_mask,
                                   vec2(u + beamlet.aperture_offset, at_analyser - row_geometry.aperture_offset),
                                   slopes, sec);
#else
        float behind = mask_transmission(light.detector_mask, u, -beamlet.aperture_offset, slope, sec);
#endif
        float passed = exp(-result.optical_depth);
        float land_x = d.target.x + result.displacement_x + result.slope_x * gap;
        float land_z = d.target.y + result.displacement_z + result.slope_z * gap;
        int to_column = int(floor(land_x / light.column_pitch + 0.5));
        int to_row = int(floor(-land_z / light.row_pitch + 0.5));
        float threshold = rounding_threshold(push.first_ray + r);
        bool stays = to_column == 0 && to_row == 0;
        uint index;
        bool lands = place_of_light(light, pixel.row + to_row, pixel.column + to_column, first_step, index);
        for (uint k = 0u; k < steps; k++) {
            float shift = light.sample_mask.present == 0u ? 0.0
                : Offsets(light.offsets).at[first_step + k] - beamlet.sample_offset;
#ifdef HEIGHTS
            float before = 0.0;
            if (heights.sample_mask.count == 0u) {
                before = mask_transmission(light.sample_mask, x, shift, slope, sec);
            } else {
                float shift_z = Offsets(heights.offsets).at[first_step + k] + row_geometry.sample_offset;
                before = transmission_of_path(light.sample_mask, heights.sample_mask,
                                              vec2(x - shift, at_mask - shift_z), slopes, sec);
            }
            float value = one * before;
#else
            float value = one * mask_transmission(light.sample_mask, x, shift, slope, sec);
#endif
            uvec2 words = fixed_point(value * behind * passed, threshold);
            if (stays) {
                own[k] = plus(own[k], words);
            } else if (lands && words != uvec2(0u)) {
                add_words(push.sums, index + k * frame, words);
            }
        }
    }
    uint index;
    if (!place_of_light(light, pixel.row, pixel.column, first_step, index)) return;
    for (uint k = 0u; k < steps; k++) add_words(push.sums, index + k * frame, own[k]);
}
