// Fits a Gaussian on a background to the illumination curve of every pixel: Levenberg-Marquardt
// in f32, then Newton's steps with twofold residuals down to the f64 optimum.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/FitPush.glsl"

#include "physics/twofold.glsl"
#include "retrieve/exponential.glsl"
#include "retrieve/solve.glsl"
#include "retrieve/curve.glsl"
#include "retrieve/levenberg_marquardt.glsl"
#include "retrieve/newton.glsl"

void put(uint pixel, uint at, float x) {
    push.fits.at[at * push.pixel_count + pixel] = x;
}

void main() {
    uint pixel = push.first + gl_GlobalInvocationID.x;
    if (pixel >= push.pixel_count) return;
    float range;
    Curve c = summarise(pixel, range);
    uint flags = c.used < push.step_count ? CURVE_SATURATED : 0u;
    if (!c.finite) {
        flags = CURVE_NOT_FINITE;
    } else if (c.used < 4u) {
        flags |= CURVE_FEW;
    } else if (range <= 1e-30) {
        flags |= CURVE_DEAD;
    }
    for (uint i = 0; i < FIT_VALUES; i++) put(pixel, i, uintBitsToFloat(0x7fc00000u));
    put(pixel, FIT_FLAGS, float(flags));
    if ((flags & ~CURVE_SATURATED) != 0u) return;

    Gaussian g = moments(c, range);
    levenberg_marquardt(c, g);
    NewtonFit last;
    if (!newton(c, g, last)) flags |= CURVE_NOT_CONVERGED;

    vec4 scale = inversesqrt(max(diagonal(last.normal), vec4(1e-30)));
    Factor f;
    bool regular = factorise(last.normal, scale, 0.0, f);
    if (!regular || condition(last.normal, scale, f) > 100.0) flags |= CURVE_ILL_CONDITIONED;
    if (g.width < push.min_width || g.width > push.max_width) flags |= CURVE_WIDTH;
    // Offsets are from -1 to 1, in any order.
    if (abs(g.centre) > 1.0) flags |= CURVE_OUTSIDE;

    // Variance of a value: known for counts, else from the residuals.
    float freedom = float(c.used) - (push.background_is_free != 0u ? 4.0 : 3.0);
    float variance = push.poisson != 0u ? push.gain * c.scale
        : freedom > 0.0 ? last.squares / freedom : uintBitsToFloat(0x7fc00000u);
    vec4 of_amplitude = scale * scale.x * substitute(f, vec4(1.0, 0.0, 0.0, 0.0));
    vec4 of_centre = scale * scale.y * substitute(f, vec4(0.0, 1.0, 0.0, 0.0));
    vec4 of_width = scale * scale.z * substitute(f, vec4(0.0, 0.0, 1.0, 0.0));
    float amplitude_error = sqrt(variance * of_amplitude.x);
    if (!(g.amplitude > 0.0) || (freedom > 0.0 && !(g.amplitude > 3.0 * amplitude_error))) {
        flags |= CURVE_NO_PEAK;
    }
    // Relative variance of the area A * width.
    float area = of_amplitude.x / (g.amplitude * g.amplitude)
        + 2.0 * of_amplitude.z / g.amplitude + of_width.z;
    put(pixel, FIT_AMPLITUDE, g.amplitude / c.scale);
    put(pixel, FIT_CENTRE, g.centre);
    put(pixel, FIT_WIDTH, g.width);
    put(pixel, FIT_BACKGROUND, c.least + g.background / c.scale);
    put(pixel, FIT_RESIDUAL, sqrt(last.squares / float(c.used)) / c.scale);
    put(pixel, FIT_AREA_SIGMA, sqrt(variance * max(area, 0.0)));
    put(pixel, FIT_CENTRE_SIGMA, g.width * sqrt(variance * of_centre.y));
    put(pixel, FIT_WIDTH_SIGMA, g.width * sqrt(variance * of_width.z));
    put(pixel, FIT_CONDITION, regular ? condition(last.normal, scale, f) : uintBitsToFloat(0x7f800000u));
    put(pixel, FIT_FLAGS, float(flags));
}
