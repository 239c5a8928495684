// The order-free walk: moments of a ray, summed over its crossings in any order.
// Runs of crossings between the same two materials are summed in registers.

#ifdef PLACED
const bool SCATTERS = (KINDS & KIND_SCATTERING) != 0u;
const bool HAS_SCATTERING_AXIS = (KINDS & KIND_SCATTERING_AXIS) != 0u;
#else
const bool SCATTERS = false;
const bool HAS_SCATTERING_AXIS = false;
#endif

struct Run {
    uint signature;
    uint balance;
    uint flags;
    uint crossings;
    uint inside; // materials of the run
    uint outside;
    float grazing; // least cosine of incidence over the one that a surface asks for
    float path;
    vec2 lever;
    vec2 slope;
    float scattering; // variance of the displacement along x per variance of angles per length, m3
    float variance; // of the displacement along x, by rough surfaces, of all runs
};

Run run_begin() {
    return Run(0u, 0u, 0u, 0u, 0u, 0u, 1e30, 0.0, vec2(0.0), vec2(0.0), 0.0, 0.0);
}

// By way of uvec2: SwiftShader ends the process on a cast of one reference to another.
Floats floats_of(Words words) {
    return Floats(uvec2(words));
}

void head_of_moments(uint head, RayResult result, uint balance) {
    push.moments.at[head + MOMENTS_SIGNATURE] = result.signature;
    push.moments.at[head + MOMENTS_BALANCE] = balance;
    push.moments.at[head + MOMENTS_FLAGS] = result.flags;
    push.moments.at[head + MOMENTS_CROSSINGS] = result.crossings;
}

// Words of the moments of a ray.
uint moments_stride() {
    uint stride = MOMENTS_HEAD + push.materials * MOMENTS_PER_MATERIAL;
#ifdef PLACED
    if ((KINDS & KIND_ROUGH) != 0u) {
        stride += push.materials * (push.materials - 1u) / 2u * MOMENTS_PER_PAIR;
    }
#endif
    if (SCATTERS) stride += push.materials;
    return stride;
}

// Word of the moment of scattering of a material; `head`: of the moments of the ray.
uint place_of_scattering(uint head, uint material) {
    return head + moments_stride() - push.materials + material;
}

// Variance of the displacement along x and along z and their covariance, over the variance along x of a material of the
// same constants that scatters alike in all directions. The displacements follow the parts of an angle along
// (1, -s_x, 0) and (0, -s_z, 1).
vec3 shares_of_directions(Beam beam, uint material) {
    ScatteringAxis axis = sample_.axes.at[material];
    vec3 own = beam_from_world_direction(beam, axis.direction);
    vec2 slope = vec2(beam.slope_x, beam.slope_z);
    vec2 part = own.xz - slope * own.y;
    vec3 shares = axis.across * vec3(1.0 + slope * slope, slope.x * slope.y)
        + axis.excess * vec3(part * part, part.x * part.y);
    return shares / (1.0 + slope.x * slope.x);
}

// Adds variances along x and z and their covariance.
void spread(inout RayResult result, vec3 variance) {
    result.displacement_variance = max(result.displacement_variance + variance.x, 0.0);
    result.variance_z = max(variance.y, 0.0);
    result.covariance = variance.z;
}

#ifdef SUMS_IN_REGISTERS
// Few materials: moments are written once, where they are wanted.
#define EACH_MATERIAL [[unroll]] for (uint m = 0u; m < MATERIALS_IN_REGISTERS; m++)
struct Sums {
    float path[MATERIALS_IN_REGISTERS];
    vec2 lever[MATERIALS_IN_REGISTERS];
    vec2 slope[MATERIALS_IN_REGISTERS];
    float scattering[MATERIALS_IN_REGISTERS];
};

Sums sums_begin(uint index, bool live) {
    Sums sums;
    EACH_MATERIAL {
        sums.path[m] = sums.scattering[m] = 0.0;
        sums.lever[m] = sums.slope[m] = vec2(0.0);
    }
    return sums;
}

void sums_add(inout Sums sums, uint material, float sign_, Run run) {
    EACH_MATERIAL {
        if (m == material) {
            sums.path[m] += sign_ * run.path;
            sums.lever[m] += sign_ * run.lever;
            sums.slope[m] += sign_ * run.slope;
            if (SCATTERS) sums.scattering[m] += sign_ * run.scattering;
        }
    }
}

RayResult result_of(Sums sums, Run run) {
    RayResult result = RayResult(0.0, 0.0, 0.0, 0.0, 0.0, run.signature, run.flags, run.crossings,
                                 run.variance, 0.0, 0.0);
    EACH_MATERIAL {
        Constants k = sample_.constants.at[min(m, push.materials - 1u)];
        if (m < push.materials) {
            result.optical_depth += k.mu * sums.path[m];
            result.displacement_x += k.delta * sums.lever[m].x;
            result.displacement_z += k.delta * sums.lever[m].y;
            result.slope_x += k.delta * sums.slope[m].x;
            result.slope_z += k.delta * sums.slope[m].y;
            if (SCATTERS && !HAS_SCATTERING_AXIS) result.displacement_variance += k.scattering * sums.scattering[m];
        }
    }
    if (SCATTERS) result.displacement_variance = max(result.displacement_variance, 0.0);
    result.variance_z = result.displacement_variance;
    return result;
}

// Gives the moments of scattering the directions of materials, and the result what follows from them.
void direct(inout Sums sums, Beam beam, inout RayResult result) {
    vec3 variance = vec3(0.0);
    EACH_MATERIAL {
        if (m < push.materials) {
            vec3 shares = shares_of_directions(beam, m);
            variance += sample_.constants.at[m].scattering * sums.scattering[m] * shares;
            sums.scattering[m] *= shares.x;
        }
    }
    spread(result, variance);
}

// True if the path in a material other than the surroundings is negative: a surface with defects is
// wound wrongly.
bool path_is_negative(Sums sums) {
    bool is_negative = false;
    EACH_MATERIAL {
        if (m > 0u && m < push.materials) is_negative = is_negative || sums.path[m] < -NEGATIVE_PATH;
    }
    return is_negative;
}

void sums_end(Sums sums, uint index, RayResult result, uint balance) {
    if (uvec2(push.moments) == uvec2(0u)) return;
    uint head = index * moments_stride();
    head_of_moments(head, result, balance);
    Floats moments = floats_of(push.moments);
    EACH_MATERIAL {
        uint first = head + MOMENTS_HEAD + m * MOMENTS_PER_MATERIAL;
        if (m < push.materials) {
            moments.at[first + MOMENTS_PATH] = sums.path[m];
            moments.at[first + MOMENTS_LEVER] = sums.lever[m].x;
            moments.at[first + MOMENTS_LEVER + 1u] = sums.lever[m].y;
            moments.at[first + MOMENTS_SLOPE] = sums.slope[m].x;
            moments.at[first + MOMENTS_SLOPE + 1u] = sums.slope[m].y;
            if (SCATTERS) moments.at[place_of_scattering(head, m)] = sums.scattering[m];
        }
    }
}
#else
struct Sums {
    uint head; // first word of the ray's moments
};

Sums sums_begin(uint index, bool live) {
    uint stride = moments_stride();
    Sums sums = Sums(index * stride);
    if (live) {
        for (uint i = MOMENTS_HEAD; i < stride; i++) push.moments.at[sums.head + i] = 0u;
    }
    return sums;
}

uint sums_place(Sums sums, uint material) {
    return sums.head + MOMENTS_HEAD + material * MOMENTS_PER_MATERIAL;
}

void sums_add(inout Sums sums, uint material, float sign_, Run run) {
    Floats moments = floats_of(push.moments);
    uint m = sums_place(sums, material);
    moments.at[m + MOMENTS_PATH] += sign_ * run.path;
    moments.at[m + MOMENTS_LEVER] += sign_ * run.lever.x;
    moments.at[m + MOMENTS_LEVER + 1u] += sign_ * run.lever.y;
    moments.at[m + MOMENTS_SLOPE] += sign_ * run.slope.x;
    moments.at[m + MOMENTS_SLOPE + 1u] += sign_ * run.slope.y;
    if (SCATTERS) moments.at[place_of_scattering(sums.head, material)] += sign_ * run.scattering;
}

RayResult result_of(Sums sums, Run run) {
    Floats moments = floats_of(push.moments);
    RayResult result = RayResult(0.0, 0.0, 0.0, 0.0, 0.0, run.signature, run.flags, run.crossings,
                                 run.variance, 0.0, 0.0);
    for (uint m = 0u; m < push.materials; m++) {
        Constants k = sample_.constants.at[m];
        uint base = sums_place(sums, m);
        result.optical_depth += k.mu * moments.at[base + MOMENTS_PATH];
        result.displacement_x += k.delta * moments.at[base + MOMENTS_LEVER];
        result.displacement_z += k.delta * moments.at[base + MOMENTS_LEVER + 1u];
        result.slope_x += k.delta * moments.at[base + MOMENTS_SLOPE];
        result.slope_z += k.delta * moments.at[base + MOMENTS_SLOPE + 1u];
        if (SCATTERS && !HAS_SCATTERING_AXIS) {
            result.displacement_variance += k.scattering * moments.at[place_of_scattering(sums.head, m)];
        }
    }
    if (SCATTERS) result.displacement_variance = max(result.displacement_variance, 0.0);
    result.variance_z = result.displacement_variance;
    return result;
}

void direct(inout Sums sums, Beam beam, inout RayResult result) {
    Floats moments = floats_of(push.moments);
    vec3 variance = vec3(0.0);
    for (uint m = 0u; m < push.materials; m++) {
        vec3 shares = shares_of_directions(beam, m);
        uint place = place_of_scattering(sums.head, m);
        variance += sample_.constants.at[m].scattering * moments.at[place] * shares;
        moments.at[place] *= shares.x;
    }
    spread(result, variance);
}

bool path_is_negative(Sums sums) {
    Floats moments = floats_of(push.moments);
    bool is_negative = false;
    for (uint m = 1u; m < push.materials; m++) {
        is_negative = is_negative || moments.at[sums_place(sums, m) + MOMENTS_PATH] < -NEGATIVE_PATH;
    }
    return is_negative;
}

void sums_end(Sums sums, uint index, RayResult result, uint balance) {
    head_of_moments(sums.head, result, balance);
}
#endif

// Ends the run.
void run_flush(inout Sums sums, inout Run run) {
    if (run.inside != run.outside) {
        sums_add(sums, run.inside, 1.0, run);
        sums_add(sums, run.outside, -1.0, run);
    }
    run.inside = run.outside = 0u;
    run.path = run.scattering = 0.0;
    run.lever = vec2(0.0);
    run.slope = vec2(0.0);
}

// Whether a crossing of the surface needs the run to end first.
bool run_ends_at(Run run, Surface surface) {
    return run.inside != run.outside && surface.inside != surface.outside
        && (run.inside != surface.inside || run.outside != surface.outside);
}

// Integral of the square of the distance to the analyser from the plane 0 to y along a ray: variance of the
// displacement along x per variance of angles along one axis and length. An angle v across a ray of the direction
// d = (s_x, 1, s_z) changes s_x by |d| (v_x - s_x v_y), and a length is |d| dy.
float squared_arm(Beam beam, Stretch stretch, float y) {
    float arm = beam.analyser;
    float length_ = stretch.length_;
    return y * (arm * (arm - y) + y * y / 3.0) * length_ * length_ * length_ * (1.0 + beam.slope_x * beam.slope_x);
}

// Counts a crossing of a surface of this hash, with its part of the signature.
void run_count(inout Run run, uint hash, uint signature, bool entering) {
    run.signature += signature;
    run.balance += entering ? hash : ~hash + 1u;
    run.crossings += signature == 0u ? 0u : 1u;
}

// Adds the change at a crossing at y. `normal_` in the beam frame.
void run_add(inout Run run, Beam beam, Stretch stretch, Surface surface, vec3 normal_, float y,
             bool entering) {
    if (surface.inside == surface.outside) return;
    vec2 slope = vec2(beam.slope_x, beam.slope_z);
    float share = incidence(slope, normal_, stretch.inverse) / max(surface.grazing, 1e-30);
    run.grazing = min(run.grazing, share);
    run.inside = surface.inside;
    run.outside = surface.outside;
    float sign_ = entering ? 1.0 : -1.0;
    vec2 g = sign_ * slope_per_delta(slope, normal_);
    run.path -= sign_ * y * stretch.length_;
    run.lever += g * (beam.analyser - y);
    run.slope += g;
    if (SCATTERS) run.scattering -= sign_ * squared_arm(beam, stretch, y);
}

// Counts and adds a crossing.
void run_cross(inout Run run, Beam beam, Stretch stretch, Surface surface, vec3 normal_, float y,
               bool entering) {
    run_count(run, surface.hash, surface.hash, entering);
    run_add(run, beam, stretch, surface, normal_, y, entering);
}
