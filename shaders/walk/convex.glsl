// Where a line crosses a cylinder, a cone, an ellipsoid or a tube (docs/developers/numerics.md, "Positions of crossings"):
// along one interval of the line, cut by the caps. So an entry and an exit are found together, or none.
// The bore of a tube takes the middle out of that interval, between the same caps.

// A convex shape in the beam frame of a pose.
struct Convex {
    bool capped;
    vec3 centre;  // m
    vec3 rest;    // what f32 leaves of it
    mat3 turn;    // own frame from the beam frame
    vec3 size;    // as the parameters of its AnalyticShape, of the scaled shape; of a tube those of
                  // the cylinder around it
    float bore;   // radius of the bore of a tube, m; 0 without one
};

// A line in the frame of a convex shape, about the plane y of its centre.
struct OwnLine {
    vec3 o;
    vec3 d;    // per y
    vec2 slab; // y at the caps
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

const bool TUBES = (KINDS & KIND_TUBE) != 0u;

Convex convex_of(Beam frame, Placed placed, AnalyticShape shape) {
    Convex convex;
    bool capped = (KINDS & (KIND_FRUSTUM | KIND_TUBE)) != 0u;
    bool both = capped && (KINDS & KIND_ELLIPSOID) != 0u;
    convex.capped = both ? shape.kind != SHAPE_ELLIPSOID : capped;
    if (MOVED) {
        Twofold3 centre = moved_from_world(frame.pose, Twofold3(placed.position, placed.rest));
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
        ? shape.parameters * vec3(scales.x, scales.z, scales.x / scales.z)
        : shape.parameters / scales;
    bool tube = TUBES && shape.kind == SHAPE_TUBE;
    convex.bore = tube ? shape.parameters.z * scales.x : 0.0;
    if (tube) convex.size.z = 0.0;
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

// A line that is `moved` by (x, z) at y = 0 and bent by a change of slope; false where it passes beside
// the caps.
bool own_line(Convex convex, Beam beam, vec2 moved, vec2 bent, out OwnLine line) {
    vec2 slope = vec2(beam.slope_x, beam.slope_z) + bent;
    // In the plane y of the centre: digits go before the rotation, not after it.
    precise vec2 off = ((vec2(beam.x, beam.z) - convex.centre.xz) + slope * convex.centre.y)
        + (moved + slope * convex.rest.y - convex.rest.xz);
    line.o = convex.turn * vec3(off.x, 0.0, off.y);
    line.d = convex.turn * vec3(slope.x, 1.0, slope.y);
    line.slab = vec2(-FAR_AWAY, FAR_AWAY);
    if (convex.capped) {
        if (abs(line.d.z) < LEAST_SLOPE) {
            // Along the caps: between them or not; no ray crosses a cap that it lies in.
            if (abs(line.o.z) >= convex.size.y) return false;
        } else {
            vec2 caps = (vec2(-convex.size.y, convex.size.y) - line.o.z) / line.d.z;
            line.slab = vec2(min(caps.x, caps.y), max(caps.x, caps.y));
        }
    } else {
        line.o *= convex.size;
        line.d *= convex.size;
    }
    return true;
}

// The interval of a line within the curved surface, whose parameters `size` are, without the caps; false
// where there is none.
bool interval(Convex convex, vec3 size, OwnLine line, out float low, out float high) {
    vec3 o = line.o;
    vec3 d = line.d;
    float widening = convex.capped ? size.z : 0.0;
    float lean = convex.capped ? -widening * (size.x + widening * o.z) : o.z;
    float stretch = convex.capped ? -widening * widening : 1.0;
    float a = dot(d.xy, d.xy) + stretch * d.z * d.z;
    float least = LEAST_SQUARE * dot(d, d);
    if (abs(a) < least) a = a < 0.0 ? -least : least;
    // From the place next to the axis, or the end of the slab that is: there the equation has all
    // its digits, and with it the discriminant.
    float base = clamp(-(dot(o.xy, d.xy) + lean * d.z) / a, line.slab.x, line.slab.y);
    vec3 p = o + base * d;
    float radius = convex.capped ? size.x + widening * p.z : 1.0;
    float away = convex.capped ? length(p.xy) : length(p);
    precise float c = 0.5 * (away - radius) * (away + radius);
    float b = dot(vec3(p.xy, convex.capped ? -widening * radius : p.z), d);
    precise float discriminant = b * b - 2.0 * a * c;
    low = high = 0.0;
    if (discriminant < 0.0 && a > 0.0) return false;
    float root = sqrt(max(discriminant, 0.0));
    float sum = -(b < 0.0 ? b - root : b + root);
    float first = sum / a;
    float second = sum == 0.0 ? first : 2.0 * c / sum;
    low = base + min(first, second);
    high = base + max(first, second);
    if (a < 0.0) {
        // Steeper than the cone: of its two halves the one that is there.
        bool widens = widening * d.z > 0.0;
        low = widens ? high : -FAR_AWAY;
        high = widens ? FAR_AWAY : base + min(first, second);
    }
    return true;
}

// y of the beam frame.
float y_of(Convex convex, float t) {
    precise float y = convex.centre.y + (t + convex.rest.y);
    return y;
}

// The chord in a convex shape, or in the cylinder around a tube.
Chord chord_of(Convex convex, OwnLine line) {
    Chord chord;
    chord.crossed = false;
    float low;
    float high;
    if (!interval(convex, convex.size, line, low, high)) return chord;
    float enter = max(low, line.slab.x);
    float leave = min(high, line.slab.y);
    if (!(enter < leave)) return chord;
    chord.crossed = true;
    chord.enter = y_of(convex, enter);
    chord.leave = y_of(convex, leave);
    vec3 lower = vec3(0.0, 0.0, line.d.z < 0.0 ? 1.0 : -1.0);
    chord.entry_normal = beam_from_own(
        convex, low > line.slab.x ? curved_normal(convex, line.o + enter * line.d) : lower);
    chord.exit_normal = beam_from_own(
        convex, high < line.slab.y ? curved_normal(convex, line.o + leave * line.d) : -lower);
    return chord;
}

// Subtracts the bore of a tube from the chord of the cylinder around it: the part before the bore, or
// behind it if there is none before; `second` is the part behind it.
void without_bore(Convex tube, OwnLine line, inout Chord chord, out Chord second) {
    second = chord;
    second.crossed = false;
    float low;
    float high;
    vec3 bore = vec3(tube.bore, tube.size.y, 0.0);
    if (!chord.crossed || !interval(tube, bore, line, low, high)) return;
    float from = max(low, line.slab.x);
    float to = min(high, line.slab.y);
    if (!(from < to)) return;
    // The caps equal those of the cylinder to the last digit: no wall remains at them in the bore.
    bool before = y_of(tube, from) > chord.enter;
    bool behind = y_of(tube, to) < chord.leave;
    second.enter = y_of(tube, to);
    second.entry_normal = beam_from_own(tube, -curved_normal(tube, line.o + to * line.d));
    if (before) {
        second.crossed = behind;
        chord.leave = y_of(tube, from);
        chord.exit_normal = beam_from_own(tube, -curved_normal(tube, line.o + from * line.d));
    } else {
        chord = second;
        chord.crossed = behind;
    }
}

// The chords of a line that is `moved` by (x, z) at y = 0 and bent by a change of slope: the second one of
// a tube alone, behind the first.
void chords_of(Convex convex, Beam beam, vec2 moved, vec2 bent, out Chord first, out Chord second) {
    OwnLine line;
    first.crossed = false;
    second.crossed = false;
    if (!own_line(convex, beam, moved, bent, line)) return;
    first = chord_of(convex, line);
    if (TUBES && convex.bore > 0.0) without_bore(convex, line, first, second);
}
