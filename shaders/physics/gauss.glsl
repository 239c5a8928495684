// The normal distribution, f32, absolute error about 1e-7 (Abramowitz and Stegun 7.1.26).

const float SQRT1_2 = 0.70710678;
const float INV_SQRT_2PI = 0.39894228;

// Density and distribution function at t.
void normal(float t, out float density, out float below) {
    float x = abs(t) * SQRT1_2;
    float e = exp(-x * x);
    float k = 1.0 / (1.0 + 0.3275911 * x);
    float tail = 0.5 * e * k
        * (0.254829592 + k * (-0.284496736 + k * (1.421413741 + k * (-1.453152027 + k * 1.061405429))));
    density = INV_SQRT_2PI * e;
    below = t < 0.0 ? tail : 1.0 - tail;
}

// Antiderivative of the distribution function: t Phi(t) + phi(t).
float ramp(float t) {
    if (t > 6.0) return t;
    if (t < -6.0) return 0.0;
    float density, below;
    normal(t, density, below);
    return t * below + density;
}
