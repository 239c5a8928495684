// Where a line crosses a torus (docs/physics.md, "Curved surfaces"). f32 finds the crossings;
// residuals in twofold arithmetic decide whether they are there, and correct them to the last digit.
// A torus is outside at both ends of a sequence of places between which each change of side is one
// crossing: they come in pairs.

#include "walk/placed.glsl"

struct TorusCrossings {
    uint count; // 0, 2 or 4, the first an entry, then by turns
    float t[4];
    float low[4]; // bounds of t
    float high[4];
};

// Half of the equation of the surface at t, < 0 inside, and half its gradient.
float residual(ShapeLine line, float t, out vec3 gradient) {
    Twofold3 p = add(line.origin, multiply(line.direction, vec3(t)));
    Twofold ring = twofold_x(line.parameters);
    Twofold tube = twofold_y(line.parameters);
    Twofold3 squares = multiply(p, p);
    Twofold flat_ = add(twofold_x(squares), twofold_y(squares));
    float root = sqrt(max(flat_.high, 1e-30));
    Twofold square = two_product(root, root);
    precise float rest = ((flat_.high - square.high) - square.low) + flat_.low;
    Twofold off = add(two_sum(root, 0.5 * rest / root), Twofold(-ring.high, -ring.low));
    gradient = vec3(p.high.xy * (off.high / root), p.high.z);
    off = add(multiply(off, off), twofold_z(squares));
    tube = multiply(tube, tube);
    Twofold sum = add(off, Twofold(-tube.high, -tube.low));
    return 0.5 * (sum.high + sum.low);
}

void put(inout TorusCrossings all, float t, float low, float high) {
    all.t[all.count] = t;
    all.low[all.count] = low;
    all.high[all.count] = high;
    all.count += 1u;
}

const uint ROOT_STEPS = 12u;

// The one root in [low, high] of k.x + k.y x + k.z x² + k.w x³ + top x⁴, near `x`; `rises`: the
// polynomial is below 0 at `low`.
float root_between(vec4 k, float top, float low, float high, float x, bool rises) {
    if (!(x >= low && x <= high)) x = 0.5 * (low + high);
    for (uint i = 0u; i < ROOT_STEPS; i++) {
        float value = (((top * x + k.w) * x + k.z) * x + k.y) * x + k.x;
        float slope = ((4.0 * top * x + 3.0 * k.w) * x + 2.0 * k.z) * x + k.y;
        if ((value < 0.0) == rises) low = x;
        else high = x;
        float next = x - value / slope;
        x = next >= low && next <= high ? next : value == 0.0 ? x : 0.5 * (low + high);
    }
    return x;
}

// Torus. In units of its ring, from the point nearest to the centre, its equation along the line
// is Q(x) = S² - 4 ρ², S = x² + m, whose slope 4 (x³ + p x + c) is a depressed cubic.
TorusCrossings torus_crossings(ShapeLine line) {
    TorusCrossings all;
    all.count = 0u;
    vec3 d = line.direction.high;
    float ring = line.parameters.high.x;
    float tube = line.parameters.high.y / ring;
    float per_t = length(d) / ring;
    float nearest = -dot(line.origin.high, d) / dot(d, d);
    vec3 o = (line.origin.high + nearest * d) / ring;
    d = normalize(d);
    float reach = (1.0 + tube) * (1.0 + tube) - dot(o, o);
    if (reach <= 0.0) return all;
    reach = 1.001 * sqrt(reach) + 1e-3;
    float m = dot(o, o) + 1.0 - tube * tube;
    float p = m - 2.0 * dot(d.xy, d.xy);
    float c = -2.0 * dot(o.xy, d.xy);
    // Where the slope is 0: once, or three times, before, between and behind +-bend.
    float bend = sqrt(max(-p / 3.0, 0.0));
    bool thrice = abs(c) < 2.0 * bend * bend * bend;
    float bound = max(2.0 * bend, 1.0 + abs(p) + abs(c));
    uint count = thrice ? 3u : 1u;
    float before = 0.0; // the place before, and half the equation there
    float equation_before = 1.0;
    float to = -bound;
    for (uint i = 0u; i <= count; i++) {
        float x = reach;
        float equation = 1.0;
        if (i < count) {
            float from = to;
            to = thrice && i < 2u ? (i == 0u ? -bend : bend) : bound;
            x = root_between(vec4(c, p, 0.0, 1.0), 0.0, from, to, 0.5 * (from + to), i != 1u);
            vec3 gradient;
            equation = residual(line, nearest + x / per_t, gradient);
        }
        if ((equation < 0.0) != (equation_before < 0.0)) {
            // One crossing lies between; expanded about the place where the equation is less: near
            // a silhouette it keeps its digits there.
            bool here = i < count && (i == 0u || abs(equation) < abs(equation_before));
            float base = here ? x : before;
            vec3 at = o + base * d;
            float q = 2.0 * (here ? equation : equation_before) / (ring * ring)
                * (base * base + m + 2.0 * length(at.xy));
            vec4 k = vec4(q, 4.0 * ((base * base + p) * base + c), 2.0 * (3.0 * base * base + p),
                          4.0 * base);
            float low = (i == 0u ? -reach : before) - base;
            float high = x - base;
            float off = sqrt(max(-q / k.z, 0.0));
            float found = base + root_between(k, 1.0, low, high, here ? -off : off,
                                              equation_before < 0.0);
            put(all, nearest + found / per_t, nearest + (base + low) / per_t,
                nearest + x / per_t);
        }
        before = x;
        equation_before = equation;
    }
    return all;
}

// y and outward unit normal of crossing i in the beam frame, to the last digit: Newton's steps from
// where f32 found it.
float torus_crossing(Beam beam, ShapeLine line, TorusCrossings all, uint i, out vec3 normal_) {
    float t = all.t[i];
    float left = 0.0; // what is left of t beyond f32
    vec3 gradient;
    for (uint newton = 0u; newton < 2u; newton++) {
        float value = residual(line, t, gradient);
        left = -value / dot(gradient, line.direction.high);
        // Beyond the middle between two crossings it would lead to the other one.
        if (!(t + left >= all.low[i] && t + left <= all.high[i])) left = 0.0;
        if (newton == 0u) t += left;
    }
    normal_ = beam_from_shape(beam, line, gradient);
    return y_of(line, t, left);
}
