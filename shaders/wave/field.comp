// Field behind the sample at the rays of lines, from their moments: exp(-depth/2 - i k delta L).
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/WaveFieldPush.glsl"

#include "physics/twofold.glsl"
#include "wave/turn.glsl"

// Cycles of phase less whole ones, before they are rounded to f32.
float cycles_of(WaveMaterial material, float path) {
    Twofold whole = two_product(material.cycles, path);
    return (whole.high - floor(whole.high + 0.5)) + (whole.low + material.cycles_low * path);
}

void main() {
    uint ray = gl_GlobalInvocationID.x;
    if (ray >= push.ray_count) return;
    uint at = ray * push.words;
    uint flags = floatBitsToUint(push.moments.at[at + MOMENTS_FLAGS]);
    at += MOMENTS_HEAD;
    float cycles = 0.0;
    float depth = 0.0;
    float displacement = 0.0;
    for (uint m = 0u; m < push.material_count; m++) {
        WaveMaterial material = push.materials.at[m];
        float path = push.moments.at[at + MOMENTS_PATH];
        float lever = push.moments.at[at + MOMENTS_LEVER];
        float slope = push.moments.at[at + MOMENTS_SLOPE];
        cycles += cycles_of(material, path);
        depth += material.half_mu * path;
        displacement += material.delta * (lever - slope * push.lever);
        at += MOMENTS_PER_MATERIAL;
    }
    // Heights of rough surfaces, by pairs of materials.
    uint own = MOMENTS_HEAD + push.material_count * MOMENTS_PER_MATERIAL + push.scattering_words;
    for (uint high = 1u; high < push.material_count && push.words > own; high++) {
        for (uint low = 0u; low < high; low++) {
            float path = push.moments.at[at + MOMENTS_HEIGHT];
            WaveMaterial gains = push.materials.at[high];
            WaveMaterial loses = push.materials.at[low];
            cycles += cycles_of(gains, path) - cycles_of(loses, path);
            depth += (gains.half_mu - loses.half_mu) * path;
            at += MOMENTS_PER_PAIR;
        }
    }
    for (uint law = 0u; law < push.laws; law++) {
        float variance = 0.0;
        for (uint m = 0u; m < push.scattering_words; m++) {
            WaveMaterial material = push.materials.at[m];
            if (material.law == law) variance += material.scattering * push.moments.at[at + m];
        }
        push.variances.at[(push.first + ray) * push.laws + law] = max(variance, 0.0);
    }
    cycles -= floor(cycles + 0.5);
    vec2 field = exp(-depth) * turned(-cycles);
    // Light of rays that are not finite is left out, and counted.
    bool is_finite = (flags & FLAG_NOT_FINITE) == 0u && abs(depth) < 1e30 && abs(displacement) < 1e30;
    push.fields.at[push.first + ray] =
        is_finite ? WaveField(field.x, field.y, displacement) : WaveField(0.0, 0.0, 0.0);
}
