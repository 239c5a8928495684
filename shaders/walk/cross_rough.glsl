// The order-free walk at surfaces that may be rough.

#include "walk/heights.glsl"

// Rough surfaces have heights along the line of the ray, no slopes: light by waves.
const bool HEIGHTS = (KINDS & KIND_HEIGHTS) != 0u;

// Whether a ray draws its normal at a surface: random rays at any incidence, rays of cells near grazing,
// where a draw changes the slope by far from a Gaussian.
bool draws_at(Beam beam, Surface surface, vec3 normal_, Gathered all) {
    return all.draws
        || incidence(slope_of(beam), normal_, all.stretch.inverse) < ROUGH_GRAZING * surface.roughness;
}

#ifndef SUMS_IN_REGISTERS
// First word of the moments of the two materials at a surface.
uint place_of_pair(Surface surface, Gathered all) {
    uint high = max(surface.inside, surface.outside);
    uint pair = high * (high - 1u) / 2u + min(surface.inside, surface.outside);
    return all.sums.head + MOMENTS_HEAD + push.materials * MOMENTS_PER_MATERIAL
        + pair * MOMENTS_PER_PAIR;
}
#endif

// Adds the path in the material inside that the height of a surface adds along a ray, at y.
void add_height(Beam beam, Surface surface, vec3 normal_, float y, Gathered all) {
#ifndef SUMS_IN_REGISTERS
    vec2 slope = slope_of(beam);
    vec2 across = vec2(beam.x, beam.z) + slope * y;
    vec3 place = world_from_beam(beam, vec3(across.x, y, across.y));
    float cosine = incidence(slope, normal_, all.stretch.inverse);
    float path = height_at(place, surface) / max(cosine, HEIGHT_COSINE * surface.roughness);
    Floats moments = floats_of(push.moments);
    moments.at[place_of_pair(surface, all) + MOMENTS_HEIGHT] +=
        surface.inside > surface.outside ? path : -path;
#endif
}

// Adds the spread of slopes along x by a rough surface, to first order: a change u of the normal n
// across it changes (n_x - n_y slope_x) / (n d) by v u.
void spread_slopes(Beam beam, Surface surface, vec3 normal_, float y, inout Gathered all) {
    vec3 direction = vec3(beam.slope_x, 1.0, beam.slope_z);
    vec3 across = vec3(1.0, -beam.slope_x, 0.0);
    float along = dot(normal_, direction);
    vec3 v = across / along - direction * (dot(across, normal_) / (along * along));
    float deviation = surface.roughness * dot(direction, direction);
    float variance = deviation * deviation * dot(v, v);
    float lever = beam.analyser - y;
    float step_ = sample_.constants.at[surface.inside].delta - sample_.constants.at[surface.outside].delta;
    all.run.variance += variance * (step_ * lever) * (step_ * lever);
#ifndef SUMS_IN_REGISTERS
    uint at = place_of_pair(surface, all) + MOMENTS_VARIANCE;
    Floats moments = floats_of(push.moments);
    moments.at[at] += variance;
    moments.at[at + 1u] += variance * lever;
    moments.at[at + 2u] += variance * lever * lever;
#endif
}

// Normal of a ray at a surface that may be rough, at y; `normal_`: of the surface, beam frame. Roughness
// without a draw is a variance.
vec3 rough_normal(Beam beam, Surface surface, uint primitive, vec3 normal_, float y, inout Gathered all) {
    vec3 met = normal_;
    if (surface.roughness > 0.0 && surface.inside != surface.outside) {
        if (HEIGHTS) {
            add_height(beam, surface, normal_, y, all);
        } else if (draws_at(beam, surface, normal_, all)) {
            float cosine = incidence(slope_of(beam), normal_, all.stretch.inverse);
            vec3 direction = vec3(beam.slope_x, 1.0, beam.slope_z);
            met = drawn_normal(normal_, direction, surface, all.key, primitive, 0u);
            all.run.grazing = min(all.run.grazing, cosine / max(surface.grazing, 1e-30));
            if (!all.draws) all.run.flags |= FLAG_DRAWN;
        } else {
            spread_slopes(beam, surface, normal_, y, all);
        }
    }
    return met;
}

// A ray crosses a surface that may be rough.
void cross_rough(Beam beam, Surface surface, uint primitive, vec3 normal_, float y, bool entering,
                 inout Gathered all) {
    vec3 met = rough_normal(beam, surface, primitive, normal_, y, all);
    run_cross(all.run, beam, all.stretch, surface, met, y, entering);
}
