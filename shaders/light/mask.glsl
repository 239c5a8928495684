// Masks: what their bars and apertures let through, as a base and a sum of hard-edged apertures
// with a blur (docs/developers/numerics.md, "Soft edges of bars").

// Values of the two edges of an aperture: one for both where walls are parallel to the axis and bars have one layer.
#ifdef WALLS
#define SIDES vec2
#define LOW(sides) ((sides).x)
#define HIGH(sides) ((sides).y)
#else
#define SIDES float
#define LOW(sides) (sides)
#define HIGH(sides) (sides)
#endif

float secant(float slope_x, float slope_z) {
    return sqrt(1.0 + slope_x * slope_x + slope_z * slope_z);
}

// An aperture of some period.
struct Place {
    int period;
    uint aperture;
};

// The next one; counted, since CPU devices divide whole numbers one lane at a time.
Place next_place(Mask mask, Place place) {
    bool last = place.aperture + 1u >= mask.count;
    return Place(last ? place.period + 1 : place.period, last ? 0u : place.aperture + 1u);
}

// The aperture there; the only one of a period without a look at memory.
Aperture aperture_of(Mask mask, Place place) {
    if (mask.count == 1u) return Aperture(mask.first, mask.last);
    return Apertures(mask.apertures).at[place.aperture];
}

// Farthest edge of an aperture from the middle of the period.
float outermost(Mask mask) {
    return mask.count == 1u ? mask.last : max(mask.last, -mask.first);
}

// The first aperture that ends beyond x, from the middle of its period; the count where none does.
uint aperture_beyond(Mask mask, float x) {
    uint first = 0u;
    uint last = mask.count;
    while (first < last) {
        uint middle = (first + last) / 2u;
        bool beyond = Apertures(mask.apertures).at[middle].high > x;
        last = beyond ? middle : last;
        first = beyond ? first : middle + 1u;
    }
    return first;
}

// Apertures within reach, in their order.
struct Reached {
    Place place; // of the first
    int count;
};

// Apertures of some periods that reach into [low, high], where they end `beyond` outside of their edges.
Reached apertures_between(Mask mask, ivec2 periods, float low, float high, float beyond) {
    Reached reached = Reached(Place(periods.x, 0u), max(periods.y - periods.x + 1, 0) * int(mask.count));
    if (mask.count == 1u || reached.count == 0) return reached;
    uint first = aperture_beyond(mask, low - beyond - float(periods.x) * mask.period);
    // Those before the last one that begins within reach.
    float end = high + beyond - float(periods.y) * mask.period;
    uint last = aperture_beyond(mask, end);
    if (last < mask.count && Apertures(mask.apertures).at[last].low < end) last++;
    reached.count = max(reached.count - int(first) - int(mask.count - last), 0);
    reached.place.aperture = first;
    if (first == mask.count) reached.place = Place(periods.x + 1, 0u);
    return reached;
}

// Share of the period that is open.
float open_part(Mask mask) {
    float open = 0.0;
    for (uint i = 0u; i < mask.count; i++) {
        open += Apertures(mask.apertures).at[i].high - Apertures(mask.apertures).at[i].low;
    }
    return open / mask.period;
}

// A mask under the angle of a beamlet. Its transmission is `leak`, plus `open` between the edges
// of apertures. These edges are soft: their place, counted outwards in units of `decay` from
// `inset` inside the edge of the aperture, has the density e^-z on [0, depth]. It is cut into
// layers, each of which is an aperture with hard edges and a Gaussian blur.
struct Bars {
    float leak;      // least transmission
    float open;      // greatest less least transmission
    float slope;     // |dx/dy| of the beamlet
    float inset;     // m
    float middle;    // the same of the mean place of a soft edge, m
    float decay;     // m
    float depth;     // in units of `decay`
    float leak_tilt; // change of `leak` with the angle, share of it per unit of dx/dy
    float open_tilt; // of `open`
    float narrowing; // of an aperture, m per unit of |dx/dy| at each edge
    float stretch;   // of the depth of soft edges, share of it per unit of |dx/dy|
    float rise;      // from the greatest inset of a soft edge to the least, m
    float cast_outside; // the greatest is cast by one face of the mask (1) or by the other (-1),
    float cast_inside;  // and so is the least
    float variance;  // of a soft edge, m2
    float reach;     // of the widest layer from the middle of the period, m
    float lattice_shift; // half a period where light is brightest behind bars, m
    float face;      // from the middle plane to the faces, m
    uint layers;
    uint cut_layers; // of the detector mask, where the edge of a pixel cuts a soft edge
};

// A layer of the soft edges: its share of `open`, and its hard edges.
struct Layer {
    float share;
    float inset;     // from the edges of the aperture at the slope of the bars, m
    SIDES narrowing; // as that of bars
    SIDES variance;  // m2
    SIDES bow;       // m2: what an edge moves by per unit of dx/dy, times the distance from the source
};

// Most layers.
const uint MOST_LAYERS = 24u;
// Error of the layers, as a share of the open beam.
const float LAYER_ERROR = 1e-6;

// Mean of z with the density e^-z on [0, depth].
float edge_mean(float depth) {
    if (depth < 0.3) return depth * (0.5 - depth * (1.0 / 12.0 - depth * depth / 720.0));
    float e = exp(-depth);
    return 1.0 - depth * e / (1.0 - e);
}

// Its change with the depth.
float edge_mean_rise(float depth) {
    if (depth < 0.3) return 0.5 - depth * (1.0 / 6.0 - depth * depth / 180.0);
    float e = exp(-depth);
    return (depth / (1.0 - e) - 1.0) * e / (1.0 - e);
}

// Its variance.
float edge_variance(float depth) {
    float square = depth * depth;
    // The difference below would lose its digits.
    if (depth < 1.0) return square * (1.0 / 12.0 - square * (1.0 / 240.0 - square / 6048.0));
    float e = exp(-depth);
    return max(1.0 - square * e / ((1.0 - e) * (1.0 - e)), 0.0);
}

// Layers that the soft edges of a mask need behind light of this blur (m, standard deviation): one
// errs by the skewness of an edge that is much deeper than its decay, and by its kurtosis, which
// falls faster with the blur and with the number of layers.
uint layers_of(Bars bars, float period, float blur) {
    float variance = max(bars.variance, 1e-24);
    float most = bars.open * sqrt(variance) / (period * LAYER_ERROR);
    float skew = EDGE_SKEWNESS * min(bars.depth / 9.0, 1.0);
    uint n = 1u;
    do {
        float count = float(n);
        float blurred = blur * blur * count;
        float flatness = variance / (variance + blurred * count);
        float error = skew * variance / (variance + blurred) + EDGE_FLATNESS * flatness * flatness;
        if (most * error <= count * count) break;
        n++;
    } while (n < MOST_LAYERS);
    return n;
}

// Bars of a material under the angle `slope`. For a window of the width of the shadow about a ray, the
// path in bars is the share of the window covered by bars; whole periods of it are covered alike
// everywhere. The rest of it begins to touch a bar, or to lose an aperture, at `start` from the middle
// of the period, and the path grows linearly from there until it contains all of the bar, or no more of
// it. Several apertures in a period are wider than the shadow, and so are their bars: then each edge
// belongs to a single one.
Bars thick_bars(Mask mask, float slope, float sec) {
    float attenuation = mask.attenuation * sec;
    bool single = mask.count == 1u;
    float aperture = single ? mask.last - mask.first : mask.narrowest_aperture;
    float bar = single ? max(mask.period - aperture, 0.0) : mask.narrowest_bar;
    float shadow = max(mask.thickness * slope, 1e-9 * mask.period);
    float periods = floor(shadow / mask.period);
    float rest = shadow - periods * mask.period;
    bool beyond_aperture = rest > aperture;
    bool beyond_bar = rest > bar;
    float covered = beyond_aperture ? rest - aperture : 0.0;
    float rise = min(min(rest, bar), min(aperture, mask.period - rest));
    float start = 0.5 * abs(aperture - rest);
    float least = exp(-attenuation * min((periods * bar + covered) / shadow, 1.0));
    float depth = attenuation * rise / shadow;
    float deep = exp(-depth);
    Bars bars;
    // Not 0, of which nothing can grow.
    bars.slope = shadow / mask.thickness;
    bars.leak = least * deep;
    bars.open = least - bars.leak;
    bars.inset = beyond_aperture ? aperture - 0.5 * rest : 0.5 * rest;
    bars.decay = shadow / attenuation;
    bars.depth = depth;
    bars.middle = bars.inset - bars.decay * edge_mean(depth);
    bars.lattice_shift = (int(periods) & 1) == 0 ? 0.0 : 0.5 * mask.period;
    // The angle changes along x, and the shadow with it.
    float per = 1.0 / shadow;
    float d_least = -attenuation * least * per * per
        * (beyond_aperture ? (periods + 1.0) * aperture : -periods * bar);
    float d_leak = -attenuation * bars.leak * per * per
        * (beyond_bar ? -(periods + 1.0) * bar : periods * aperture);
    bars.leak_tilt = bars.leak > 1e-7 ? mask.thickness * d_leak / bars.leak : 0.0;
    bars.open_tilt = bars.open > 1e-7 ? mask.thickness * (d_least - d_leak) / bars.open : 0.0;
    float d_start = beyond_aperture ? 0.5 : -0.5;
    float d_rise = beyond_bar ? (beyond_aperture ? -1.0 : 0.0) : (beyond_aperture ? 0.0 : 1.0);
    float d_depth = attenuation * per * (d_rise - rise * per);
    bars.narrowing = -mask.thickness
        * (d_start + edge_mean(depth) / attenuation + bars.decay * edge_mean_rise(depth) * d_depth);
    bars.cast_outside = beyond_aperture ? -1.0 : 1.0;
    bars.cast_inside = beyond_bar ? 1.0 : -1.0;
    bars.rise = rise;
    float spread = edge_variance(depth);
    bars.variance = bars.decay * bars.decay * spread;
    // Soft edges grow with the shadow. Where bar or aperture bound them, `depth` falls instead, and
    // with it their deviation in units of `decay`.
    bars.stretch = 1.0 / bars.slope;
    if (beyond_bar || beyond_aperture) {
        float more = 0.02;
        float rise_of_variance = edge_variance((1.0 + more) * depth) / spread - 1.0;
        bars.stretch *= 1.0 - 0.5 * rise_of_variance / more;
    }
    bars.reach = single ? max(mask.last, start + rise) : outermost(mask) + 0.5 * rest;
    bars.face = 0.5 * mask.thickness;
    bars.layers = bars.cut_layers = 1u;
    return bars;
}

#ifdef WALLS
#include "light/walls.glsl"
#endif

// Bars without their substrate, before light of a blur (m in the plane of evaluation).
Bars bare_bars_of(Mask mask, float slope_x, float sec, float blur) {
    float slope = abs(slope_x);
#ifdef WALLS
    // Of the wall whose shadow is wider.
    slope += abs(mask.taper);
#endif
    if (mask.present != 0u && mask.averaged == 0u && mask.attenuation > 0.0) {
        Bars bars = thick_bars(mask, slope, sec);
#ifdef WALLS
        bars.variance = widest_variance(mask, bars, slope);
#endif
        bars.layers = layers_of(bars, mask.period, blur);
        if (slope_x < 0.0) {
            bars.leak_tilt = -bars.leak_tilt;
            bars.open_tilt = -bars.open_tilt;
        }
        return bars;
    }
    float shadow = mask.thickness * slope;
    float leak = mask.present == 0u ? 1.0 : (mask.averaged != 0u ? 0.0 : mask.transmission);
    float variance = mask.averaged != 0u ? shadow * shadow * mask.edge_variance : 0.0;
    return Bars(leak, 1.0 - leak, slope, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0,
                variance, outermost(mask), 0.0, 0.0, 1u, 1u);
}

// Share of the light that the substrate of a mask lets through.
float through_substrate(Mask mask, float sec) {
    return mask.present != 0u && mask.substrate > 0.0 ? exp(-mask.substrate * sec) : 1.0;
}

// A mask under an angle, before light of a blur (m in the plane of evaluation).
Bars bars_of(Mask mask, float slope_x, float sec, float blur) {
    Bars bars = bare_bars_of(mask, slope_x, sec, blur);
    if (mask.substrate > 0.0) {
        float share = through_substrate(mask, sec);
        bars.leak *= share;
        bars.open *= share;
    }
    return bars;
}

// Additional shift of the edges of an aperture that lie `inset` inside of it (m2: per unit of dx/dy,
// times the distance from the source). A corner of a bar appears in the middle plane displaced by its
// angle times its distance from there, and by the square of that. The faces of the mask cast the ends of
// soft edges, and the inside casts the rest.
float bow_of(Bars bars, float inset) {
    if (!(bars.rise > 0.0)) return 0.0;
    float outside = (inset - bars.inset) / bars.rise + 1.0;
    return bars.face * mix(bars.cast_inside, bars.cast_outside, outside) * inset / bars.slope;
}

// Whether x lies in a soft edge of an aperture with the middle `centre`.
bool in_soft_edge(Bars bars, Aperture aperture, float centre, float x) {
    float from_low = x - (centre + aperture.low) - bars.inset;
    float from_high = (centre + aperture.high) - x - bars.inset;
    return (from_low < 0.0 && from_low > -bars.rise) || (from_high < 0.0 && from_high > -bars.rise);
}

#ifndef WALLS
// Layers are cut at equal steps of the third root of the density.
Layer layer_of(Bars bars, uint index, uint layers) {
    if (layers == 1u) {
        return Layer(bars.open, bars.middle, bars.narrowing, bars.variance, bow_of(bars, bars.middle));
    }
    float fall = (1.0 - exp(-bars.depth / 3.0)) / float(layers);
    bool last = index + 1u == layers;
    float from = -3.0 * log(1.0 - fall * float(index));
    float to = last ? bars.depth : -3.0 * log(1.0 - fall * float(index + 1u));
    float depth = to - from;
    float share = exp(-from) * (1.0 - exp(-depth)) / (1.0 - exp(-bars.depth));
    float inset = bars.inset - bars.decay * (from + edge_mean(depth));
    return Layer(bars.open * share, inset, bars.narrowing + (inset - bars.middle) * bars.stretch,
                 bars.decay * bars.decay * edge_variance(depth), bow_of(bars, inset));
}
#endif

// dx/dy of a ray through x against the walls at the low and the high edge of an aperture, where it is `slope` at 0;
// `plane`: distance from the source.
vec2 wall_slopes(Mask mask, float slope, float low, float high, float plane) {
    vec2 slopes = vec2(slope + low / plane, slope + high / plane);
#ifdef WALLS
    slopes += vec2(mask.taper, -mask.taper);
#endif
    return slopes;
}

// A layer of the `layers` of an aperture about `centre`, which is seen under `slope` at the place 0.
Layer layer_at(Mask mask, Bars bars, Aperture aperture, float centre, float slope, float plane, uint index,
               uint layers) {
#ifdef WALLS
    vec2 slopes = wall_slopes(mask, slope, centre + aperture.low, centre + aperture.high, plane);
    return layer_of(mask, bars, slopes, index, layers);
#else
    return layer_of(bars, index, layers);
#endif
}

// Hard edges of an aperture. Per standard deviation of the source offset the low one moves by
// -low_turn and the high one by high_turn, since it is seen under another angle.
struct Edges {
    float low;
    float high;
    float low_turn;
    float high_turn;
    // Second order in the offset t of the source (standard deviations), near the axis alone: each edge moves
    // inwards by this length times t^2 - 1.
    float low_bend;
    float high_bend;
};

// |slope| spread normally by `spread`: its mean, its change per standard deviation, and its change with
// the square of the deviation less 1.
vec3 mean_size(float slope, float spread) {
    float size = abs(slope);
    float way = slope < 0.0 ? -1.0 : 1.0;
    if (!(size < 6.0 * spread)) return vec3(size, way, 0.0);
    float density, below;
    normal(size / spread, density, below);
    float sure = 2.0 * below - 1.0;
    return vec3(sure * size + 2.0 * spread * density, way * sure, density);
}

// Edges of an aperture with the middle `centre`, each seen under its own angle, which is `slope` at the
// place 0; `plane`: distance from the source, whose width is `spot` (standard deviation). `narrowing`:
// share of the shadow that narrows the apertures of averaged masks, a field of the cell.
Edges edges_of(Mask mask, Bars bars, Layer layer, Aperture aperture, float centre, float slope,
               float plane, float spot, float narrowing) {
    float low = centre + aperture.low;
    float high = centre + aperture.high;
    bool averaged = mask.averaged != 0u;
    SIDES per = averaged ? SIDES(0.5 * mask.thickness * narrowing) : layer.narrowing;
    float from = averaged ? 0.0 : bars.slope;
#ifdef WALLS
    // Edges are in proportion to the slope against their walls.
    from = 0.0;
#endif
    float spread = spot / plane;
    vec2 slopes = wall_slopes(mask, slope, low, high, plane);
    float low_slope = slopes.x;
    float high_slope = slopes.y;
    vec3 at_low = mean_size(low_slope, spread);
    vec3 at_high = mean_size(high_slope, spread);
    SIDES bow = (averaged ? per * per : layer.bow) / plane;
    return Edges(low + layer.inset + LOW(per) * (at_low.x - from) + LOW(bow) * low_slope,
                 high - layer.inset - HIGH(per) * (at_high.x - from) + HIGH(bow) * high_slope,
                 LOW(per) * spread * at_low.y, HIGH(per) * spread * at_high.y,
                 LOW(per) * spread * at_low.z, HIGH(per) * spread * at_high.z);
}
