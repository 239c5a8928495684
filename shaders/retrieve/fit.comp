#version 460
// Fits a Gaussian on a background to the illumination curve of every pixel: Levenberg-Marquardt
// in f32, then Newton's steps with twofold residuals down to the f64 optimum.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform FitPush {
    Steps steps;
    Curves curves;    // [step][pixel]
    Fits fits;        // [value][pixel]
    uint step_count;
    uint pixel_count;
    uint first;       // pixel of this dispatch
    uint poisson;     // weights of counts, from the fit
    float gain;       // value of one count, for the variance of weighted fits
    float saturation; // values from here on are left out
    float narrow;     // least and most width that counts as one
    float wide;
} push;

#include "retrieve/twofold.glsl"
#include "retrieve/solve.glsl"
#include "retrieve/curve.glsl"
#include "retrieve/rough.glsl"
#include "retrieve/polish.glsl"

// Twins of the bits in engine/retrieve/flags.rs.
const uint DEAD = 1u;
const uint NOT_FINITE = 2u;
const uint SATURATED = 4u;
const uint FEW = 8u;
const uint NOT_CONVERGED = 16u;
const uint ILL_CONDITIONED = 32u;
const uint WIDTH = 64u;
const uint OUTSIDE = 128u;
const uint NO_PEAK = 256u;

void put(uint pixel, uint at, float x) {
    push.fits.at[at * push.pixel_count + pixel] = x;
}

void main() {
    uint pixel = push.first + gl_GlobalInvocationID.x;
    if (pixel >= push.pixel_count) return;
    float range;
    Curve c = look(pixel, range);
    uint flags = c.used < push.step_count ? SATURATED : 0u;
    if (!c.finite) {
        flags = NOT_FINITE;
    } else if (c.used < 4u) {
        flags |= FEW;
    } else if (range <= 1e-30) {
        flags |= DEAD;
    }
    for (uint i = 0; i < 10; i++) put(pixel, i, uintBitsToFloat(0x7fc00000u));
    put(pixel, 9, float(flags));
    if ((flags & ~SATURATED) != 0u) return;

    Gaussian g = moments(c, range);
    rough(c, g);
    Polished last;
    if (!polish(c, g, last)) flags |= NOT_CONVERGED;

    vec4 scale = inversesqrt(max(diagonal(last.normal), vec4(1e-30)));
    Factor f;
    bool regular = factorise(last.normal, scale, 0.0, f);
    if (!regular || condition(last.normal, scale, f) > 100.0) flags |= ILL_CONDITIONED;
    if (g.width < push.narrow || g.width > push.wide) flags |= WIDTH;
    float first = push.steps.at[0].offset;
    float end = push.steps.at[push.step_count - 1u].offset;
    if (g.centre < min(first, end) || g.centre > max(first, end)) flags |= OUTSIDE;

    // Variance of a value: known for counts, else from the residuals.
    float freedom = float(c.used) - 4.0;
    float variance = push.poisson != 0u ? push.gain * c.scale
        : freedom > 0.0 ? last.squares / freedom : uintBitsToFloat(0x7fc00000u);
    vec4 of_amplitude = scale * scale.x * substitute(f, vec4(1.0, 0.0, 0.0, 0.0));
    vec4 of_centre = scale * scale.y * substitute(f, vec4(0.0, 1.0, 0.0, 0.0));
    vec4 of_width = scale * scale.z * substitute(f, vec4(0.0, 0.0, 1.0, 0.0));
    float amplitude_error = sqrt(variance * of_amplitude.x);
    if (!(g.amplitude > 0.0) || (freedom > 0.0 && !(g.amplitude > 3.0 * amplitude_error))) {
        flags |= NO_PEAK;
    }
    // Relative variance of the area A * width.
    float area = of_amplitude.x / (g.amplitude * g.amplitude)
        + 2.0 * of_amplitude.z / g.amplitude + of_width.z;
    put(pixel, 0, g.amplitude / c.scale);
    put(pixel, 1, g.centre);
    put(pixel, 2, g.width);
    put(pixel, 3, c.least + g.background / c.scale);
    put(pixel, 4, sqrt(last.squares / float(c.used)) / c.scale);
    put(pixel, 5, sqrt(variance * max(area, 0.0)));
    put(pixel, 6, g.width * sqrt(variance * of_centre.y));
    put(pixel, 7, g.width * sqrt(variance * of_width.z));
    put(pixel, 8, regular ? condition(last.normal, scale, f) : uintBitsToFloat(0x7f800000u));
    put(pixel, 9, float(flags));
}
