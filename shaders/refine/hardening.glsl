// Light of all energies that passes an optical depth at the constants of the rays.

float light_behind(float depth) {
    if (!has_spectrum() || !(depth > 0.0)) return exp(-depth);
    float place = sqrt(min(depth / float(HARDENING_DEEPEST), 1.0)) * float(HARDENING_PLACES - 1u);
    uint first = min(uint(place), HARDENING_PLACES - 2u);
    return exp(-mix(S.hardening.at[first], S.hardening.at[first + 1u], place - float(first)));
}
