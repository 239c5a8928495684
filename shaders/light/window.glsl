// Share of the light of a piece that lands between two edges on the analyser, uniform in xi and
// normal in the source offset t (docs/developers/numerics.md, "Cells").

// Steepness of edges at the ends of a piece that an aperture does not cut.
const float STEEP = 2e4;
// Standard deviations from an edge to where it cuts nothing.
const float BEYOND = 8.0;
// Bound of t beyond which the normal distribution is 0 or 1, and beyond which the digits of a square do not do.
const float CERTAIN = 6.0;
const float HARD = 32.0;

// Light of a piece over xi and t, as a share of that in its middle:
// level - depth_change * xi + turn * t.
struct Profile {
    float level;
    float depth_change; // half the change of optical depth over the piece
    float turn;         // bars are seen under other angles from elsewhere in the spot
};

// Light of a cell, or of its part behind a hard edge, on the analyser: evenly spread over middle +
// half_width * xi, xi in [-1, 1], moved by -blur * t.
struct Piece {
    bool passes; // some of its light
    float amount;
    float middle;
    float half_width; // signed: light may land in reverse order
    float blur;       // at edges of the detector mask
    float pixel_blur; // at edges of pixels
    float pixel_shift;
    float by_spot;            // share of the spot in `blur`
    Profile profile;
    bool changes_sign;        // of its light, somewhere
    float detector_narrowing;
    SIDES sample_covariance; // over the half width of the piece in the cell plane
    float detector_covariance;
    // The aperture of the sample mask lets t through between low - steep_low * xi and
    // high - steep_high * xi.
    float low;
    float high;
    float steep_low;
    float steep_high;
    // Second order in t: each edge moves inwards by this times t^2 - 1.
    float low_bend;
    float high_bend;
};

// An edge on the analyser, and the blur of light there.
struct Edge {
    float at;
    float blur;
    float bend; // second order in t: it moves inwards by this length times t^2 - 1
};

// Integral of the profile over xi in [p, q].
float profile_between(float p, float q, Profile profile) {
    return (q - p) * (profile.level - 0.5 * profile.depth_change * (p + q));
}

// Integral of the profile over xi in [p, q] and over all t below a bound that goes from a to b, both within HARD. The bound
// is higher by bend * (t^2 - 1).
float below_near(float a, float b, float p, float q, Profile profile, float bend) {
    float depth_change = profile.depth_change;
    float density_a, below_a, density_b, below_b;
    normal(a, density_a, below_a);
    normal(b, density_b, below_b);
    float h = q - p;
    float w = b - a;
    float at_a = profile.level - depth_change * p;
    float at_b = profile.level - depth_change * q;
    if (abs(w) < 0.5) {
        // The closed form would lose its digits: Euler and Maclaurin's sum.
        float first = w * (at_b * density_b - at_a * density_a) - depth_change * h * (below_b - below_a);
        float third = w * w
            * (w * (at_b * (b * b - 1.0) * density_b - at_a * (a * a - 1.0) * density_a)
               + 3.0 * depth_change * h * (b * density_b - a * density_a));
        float bent = (bend * (a * a - 1.0) - profile.turn) * density_a
            + (bend * (b * b - 1.0) - profile.turn) * density_b;
        return h * (0.5 * (at_a * below_a + at_b * below_b + bent) - first / 12.0 + third / 720.0);
    }
    float per = h / w;
    float once = at_b * (b * below_b + density_b) - at_a * (a * below_a + density_a);
    float twice = 0.5 * ((b * b + 1.0) * below_b + b * density_b - (a * a + 1.0) * below_a
                         - a * density_a);
    float bent = bend * (a * density_a - b * density_b) - profile.turn * (below_b - below_a);
    return per * (once + depth_change * per * twice + bent);
}

// The same for any bound. Bounds at hard edges are millions of standard deviations, and their squares would leave no
// digits of the difference: beyond CERTAIN all or none of the light is below.
float below_between(float a, float b, float p, float q, Profile profile, float bend) {
    float certain = 0.0;
    if (max(abs(a), abs(b)) > HARD) {
        float near_a = clamp(a, -CERTAIN, CERTAIN);
        float near_b = clamp(b, -CERTAIN, CERTAIN);
        float w = abs(b - a) < 1e-20 ? 1e-20 : b - a;
        float from = p + clamp((near_a - a) / w, 0.0, 1.0) * (q - p);
        float to = q - clamp((b - near_b) / w, 0.0, 1.0) * (q - p);
        certain = (a > CERTAIN ? profile_between(p, from, profile) : 0.0)
            + (b > CERTAIN ? profile_between(to, q, profile) : 0.0);
        a = near_a;
        b = near_b;
        p = from;
        q = to;
    }
    return certain + below_near(a, b, p, q, profile, bend);
}

// Intersection of two lines, cut to [-1, 1].
float meeting(float apart, float slope) {
    return clamp(apart / (abs(slope) < 1e-12 ? 1e-12 : slope), -1.0, 1.0);
}

// By how much the share between two edges changes with energies that an edge of the aperture at xi
// takes away.
float leaning(Piece piece, float covariance, float xi, float low, float low_blur, float high, float high_blur) {
    if (abs(xi) > 1.0) return 0.0;
    float at = piece.middle + piece.half_width * xi;
    float l = (low - at) / low_blur;
    float h = (high - at) / high_blur;
    return 0.5 * covariance * INV_SQRT_2PI
        * (exp(-0.5 * l * l) / low_blur - exp(-0.5 * h * h) / high_blur);
}

// Share of the piece between two edges. At xi the aperture and the edges each leave an interval of t;
// both together leave, with F(u, l) = max(Phi(u) - Phi(l), 0) of an upper and a lower bound u, l, F(ua,
// le) - F(ua, ue) - F(la, le) + F(la, ue). Bounds are linear in xi and steeper for the aperture, so that
// each F ends at the intersection of its lines, and integrals of Phi along each line between two
// intersections remain.
float window(Piece piece, Edge low, Edge high) {
    float least = max(2e-6 * abs(piece.half_width), 1e-12);
    float low_blur = max(low.blur, least);
    float high_blur = max(high.blur, least);
    float steep_low = piece.steep_low;
    float steep_high = piece.steep_high;
    if ((steep_low * low_blur + piece.half_width > 0.0)
        != (steep_low * high_blur + piece.half_width > 0.0)) {
        low_blur = high_blur = 0.5 * (low_blur + high_blur);
    }
    float upper = (piece.middle - low.at) / low_blur;
    float lower = (piece.middle - high.at) / high_blur;
    float upper_slope = piece.half_width / low_blur;
    float lower_slope = piece.half_width / high_blur;
    float turned = upper_slope + steep_low < 0.0 ? -0.5 : 0.5;
    float high_lower = meeting(piece.high - lower, lower_slope + steep_high);
    float high_upper = meeting(piece.high - upper, upper_slope + steep_high);
    float low_lower = meeting(piece.low - lower, lower_slope + steep_low);
    float low_upper = meeting(piece.low - upper, upper_slope + steep_low);
    Profile profile = piece.profile;
    // Edges of the aperture that do not cut the piece are put at its ends.
    bool cut_high = piece.high < steep_high + BEYOND;
    bool cut_low = piece.low > -steep_low - BEYOND;
    if (!cut_high) high_lower = high_upper = 2.0 * turned;
    if (!cut_low) low_lower = low_upper = -2.0 * turned;
    float share = below_between(upper + upper_slope * low_upper, upper + upper_slope * high_upper,
                                low_upper, high_upper, profile, -low.bend / low_blur)
        - below_between(lower + lower_slope * low_lower, lower + lower_slope * high_lower,
                        low_lower, high_lower, profile, high.bend / high_blur);
    if (cut_high) {
        share += below_between(piece.high - steep_high * high_upper,
                               piece.high - steep_high * high_lower, high_upper, high_lower, profile,
                               -piece.high_bend);
    }
    if (cut_low) {
        share -= below_between(piece.low - steep_low * low_upper, piece.low - steep_low * low_lower,
                               low_upper, low_lower, profile, piece.low_bend);
    }
    share *= turned;
    if (piece.sample_covariance != SIDES(0.0)) {
        // Energies that an edge takes away more of are displaced more, there alone.
        if (cut_high) {
            share -= leaning(piece, HIGH(piece.sample_covariance), piece.high / steep_high, low.at, low_blur,
                             high.at, high_blur);
        }
        if (cut_low) {
            share -= leaning(piece, LOW(piece.sample_covariance), piece.low / steep_low, low.at, low_blur,
                             high.at, high_blur);
        }
    }
    return share;
}
