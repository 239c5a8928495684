// The order-free walk at surfaces that may be rough.

// Whether rays of cells draw the normals of a surface at this incidence: what draws do to the slope is
// then far from a Gaussian.
bool draws(Surface surface, vec2 slope, vec3 normal_, float inverse_stretch) {
    return incidence(slope, normal_, inverse_stretch) < ROUGH_GRAZING * surface.roughness;
}

#ifndef SUMS_IN_REGISTERS
// Adds to the moments of the pair of materials what a rough surface spreads slopes along x, to first
// order: a change u of the normal n across it changes (n_x - n_y slope_x) / (n d) by v u.
void spread_slopes(Beam beam, Surface surface, vec3 normal_, float y, Gathered all) {
    vec3 direction = vec3(beam.slope_x, 1.0, beam.slope_z);
    vec3 across = vec3(1.0, -beam.slope_x, 0.0);
    float along = dot(normal_, direction);
    vec3 v = across / along - direction * (dot(across, normal_) / (along * along));
    float deviation = surface.roughness * dot(direction, direction);
    float variance = deviation * deviation * dot(v, v);
    float lever = beam.analyser - y;
    uint high = max(surface.inside, surface.outside);
    uint pair = high * (high - 1u) / 2u + min(surface.inside, surface.outside);
    uint at = all.sums.head + MOMENTS_HEAD + push.materials * MOMENTS_PER_MATERIAL
        + pair * MOMENTS_PER_PAIR + MOMENTS_VARIANCE;
    Floats moments = floats_of(push.moments);
    moments.at[at] += variance;
    moments.at[at + 1u] += variance * lever;
    moments.at[at + 2u] += variance * lever * lever;
}
#endif

// A ray crosses a surface that may be rough, at y; `normal_`: of the surface, beam frame. Rays with a
// key draw another; for those without the variance is a moment, and those near grazing are put on the
// list of rays to trace exactly, where they draw.
void cross_rough(Beam beam, Surface surface, uint primitive, vec3 normal_, float y, bool entering,
                 inout Gathered all) {
    vec3 met = normal_;
    if (surface.roughness > 0.0 && surface.inside != surface.outside) {
        float inverse_stretch = all.stretch.inverse;
        if (all.key != 0u) {
            vec3 direction = vec3(beam.slope_x, 1.0, beam.slope_z);
            met = drawn_normal(normal_, direction, surface, all.key, primitive, 0u);
            float share = incidence(slope_of(beam), normal_, inverse_stretch);
            all.run.grazing = min(all.run.grazing, share / max(surface.grazing, 1e-30));
        } else if (draws(surface, slope_of(beam), normal_, inverse_stretch)) {
            all.run.grazing = 0.0;
            all.run.flags |= FLAG_DRAWN;
#ifndef SUMS_IN_REGISTERS
        } else {
            spread_slopes(beam, surface, normal_, y, all);
#endif
        }
    }
    run_cross(all.run, beam, all.stretch, surface, met, y, entering);
}
