// Light of all energies that passes an optical depth at the constants of the rays (engine/simulate/sampling/hardening.rs).

float light_behind(float depth) {
    if (uvec2(P.hardening) == uvec2(0u) || !(depth > 0.0)) return exp(-depth);
    float within = min(depth, float(HARDENING_DEEPEST));
    float place = sqrt(within / float(HARDENING_DEEPEST)) * float(HARDENING_PLACES - 1u);
    uint first = min(uint(place), HARDENING_PLACES - 2u);
    float ratio = mix(P.hardening.at[first], P.hardening.at[first + 1u], place - float(first));
    return exp(-(ratio * within + P.hardening.at[HARDENING_PLACES] * (depth - within)));
}
