// Where a line crosses a cylinder, a cone or an ellipsoid (docs/physics.md, "Curved surfaces"): along
// one interval of the line, cut by the caps. So an entry and an exit are found together, or none.

// A convex shape in the beam frame of a view.
struct Convex {
    bool capped;
    vec3 centre;  // m
    vec3 rest;    // what f32 leaves of it
    mat3 turn;    // own frame from the beam frame
    vec3 size;    // as the parameters of its AnalyticShape, of the scaled shape
};

// The part of a line that lies in a convex shape.
struct Chord {
    bool crossed;
    float enter; // y in the beam frame
    float leave;
    vec3 entry_normal; // unit, outward, beam frame
    vec3 exit_normal;
};

const float FAR_AWAY = 1e6;       // m
const float LEAST_SLOPE = 1e-9;   // to a cap; f32 holds a rotation to 4e-8
const float LEAST_SQUARE = 1e-12; // least coefficient of t², of that of a line across

Convex convex_of(Beam frame, Placed placed, AnalyticShape shape) {
    Convex convex;
    bool both = (KINDS & KIND_FRUSTUM) != 0u && (KINDS & KIND_ELLIPSOID) != 0u;
    convex.capped = both ? shape.kind == SHAPE_FRUSTUM : (KINDS & KIND_FRUSTUM) != 0u;
    if (MOVED) {
        Twofold3 centre = moved_from_world(frame.view, Twofold3(placed.position, placed.rest));
        convex.centre = centre.high;
        convex.rest = centre.low;
    } else {
        convex.centre = beam_from_world(frame, placed.position);
        convex.rest = beam_from_world(frame, placed.rest);
    }
    vec4 back = vec4(-placed.rotation.xyz, placed.rotation.w);
    vec3 x = turned(back, world_from_beam_direction(frame, vec3(1.0, 0.0, 0.0)));
    vec3 y = turned(back, world_from_beam_direction(frame, vec3(0.0, 1.0, 0.0)));
    vec3 z = turned(back, world_from_beam_direction(frame, vec3(0.0, 0.0, 1.0)));
    convex.turn = mat3(x, y, z);
    vec3 scales = scales_of(placed);
    convex.size = convex.capped
        ? shape.high * vec3(scales.x, scales.z, scales.x / scales.z)
        : shape.high / scales;
    return convex;
}

// The outward normal of a curved surface at a point, own frame.
vec3 curved_normal(Convex convex, vec3 p) {
    if (!convex.capped) return p * convex.size;
    float radius = convex.size.x + convex.size.z * p.z;
    vec3 gradient = vec3(p.xy, -convex.size.z * radius);
    // The tip of a cone.
    return dot(gradient, gradient) == 0.0 ? vec3(0.0, 0.0, 1.0) : gradient;
}

vec3 beam_from_own(Convex convex, vec3 n) {
    return normalize(n * convex.turn);
}

// The chord of a line that is `moved` by (x, z) at y = 0 and bent by a change of slope.
Chord chord_of(Convex convex, Beam beam, vec2 moved, vec2 bent) {
    Chord chord;
    chord.crossed = false;
    vec2 slope = vec2(beam.slope_x, beam.slope_z) + bent;
    // In the plane y of the centre: digits go before the rotation, not after it.
    precise vec2 off = ((vec2(beam.x, beam.z) - convex.centre.xz) + slope * convex.centre.y)
        + (moved + slope * convex.rest.y - convex.rest.xz);
    vec3 o = convex.turn * vec3(off.x, 0.0, off.y);
    vec3 d = convex.turn * vec3(slope.x, 1.0, slope.y);
    vec3 size = convex.size;
    float widening = convex.capped ? size.z : 0.0;
    vec2 slab = vec2(-FAR_AWAY, FAR_AWAY);
    if (convex.capped) {
        if (abs(d.z) < LEAST_SLOPE) {
            // Along the caps: between them or not; no ray crosses a cap that it lies in.
            if (abs(o.z) >= size.y) return chord;
        } else {
            vec2 caps = (vec2(-size.y, size.y) - o.z) / d.z;
            slab = vec2(min(caps.x, caps.y), max(caps.x, caps.y));
        }
    } else {
        o *= size;
        d *= size;
    }
    float lean = convex.capped ? -widening * (size.x + widening * o.z) : o.z;
    float stretch = convex.capped ? -widening * widening : 1.0;
    float a = dot(d.xy, d.xy) + stretch * d.z * d.z;
    float least = LEAST_SQUARE * dot(d, d);
    if (abs(a) < least) a = a < 0.0 ? -least : least;
    // From the place next to the axis, or the end of the slab that is: there the equation has all
    // its digits, and with it the discriminant.
    float base = clamp(-(dot(o.xy, d.xy) + lean * d.z) / a, slab.x, slab.y);
    vec3 p = o + base * d;
    float radius = convex.capped ? size.x + widening * p.z : 1.0;
    float away = convex.capped ? length(p.xy) : length(p);
    precise float c = 0.5 * (away - radius) * (away + radius);
    float b = dot(vec3(p.xy, convex.capped ? -widening * radius : p.z), d);
    precise float discriminant = b * b - 2.0 * a * c;
    if (discriminant < 0.0 && a > 0.0) return chord;
    float root = sqrt(max(discriminant, 0.0));
    float sum = -(b < 0.0 ? b - root : b + root);
    float first = sum / a;
    float second = sum == 0.0 ? first : 2.0 * c / sum;
    float low = base + min(first, second);
    float high = base + max(first, second);
    if (a < 0.0) {
        // Steeper than the cone: of its two halves the one that is there.
        bool widens = widening * d.z > 0.0;
        low = widens ? high : -FAR_AWAY;
        high = widens ? FAR_AWAY : base + min(first, second);
    }
    float enter = max(low, slab.x);
    float leave = min(high, slab.y);
    if (!(enter < leave)) return chord;
    chord.crossed = true;
    precise float entry = convex.centre.y + (enter + convex.rest.y);
    precise float exit_ = convex.centre.y + (leave + convex.rest.y);
    chord.enter = entry;
    chord.leave = exit_;
    vec3 lower = vec3(0.0, 0.0, d.z < 0.0 ? 1.0 : -1.0);
    chord.entry_normal = beam_from_own(
        convex, low > slab.x ? curved_normal(convex, o + enter * d) : lower);
    chord.exit_normal = beam_from_own(
        convex, high < slab.y ? curved_normal(convex, o + leave * d) : -lower);
    return chord;
}
