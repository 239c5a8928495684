// Light of a piece of a cell on the analyser, and the part that passes the detector mask.

const float NEGLIGIBLE = 1e-9; // leaks below this are left out
const float FAINT = 1e-5;      // where in its pixel the light of leaks below this lands is left open

// Everything about the band. Here rather than handed from function to function: copies of so much
// take their time when a driver makes the kernel.
IlluminationParams light;

// Width of the focal spot, m, standard deviation.
float source_spot() {
    return light.spot * light.rotation_distance / (light.analyser - light.rotation_distance);
}

// Periods of the detector mask with an aperture where light of a piece lands.
ivec2 periods_in_reach(Mask mask, Bars bars, BeamletGeometry beamlet, Piece piece) {
    float reach = abs(piece.half_width) + 6.5 * piece.blur + bars.reach;
    float middle = piece.middle + beamlet.aperture_offset;
    return ivec2(int(ceil((middle - reach) / mask.period)),
                 int(floor((middle + reach) / mask.period)));
}

// Which of the piece, from xi to xi, the aperture of the sample mask leaves on average.
vec2 between_edges(Piece piece) {
    return vec2(max(piece.low / piece.steep_low, -1.0), min(piece.high / piece.steep_high, 1.0));
}

// As `window`, with a transmission that changes by this share per m of the ray's place, as bars do with
// the angle. It may fall below zero: if a shadow is as wide as a period, openings get darker than the
// leaks of bars.
float through_bars(Piece piece, Edge low, Edge high, float tilt) {
    float level = 1.0 + tilt * piece.middle;
    float turn = tilt * (light.spot + source_spot()) * piece.by_spot;
    Profile before = piece.profile;
    piece.profile = Profile(level * before.level,
                            level * before.depth_change - before.level * tilt * piece.half_width,
                            level * before.turn - before.level * turn);
    return window(piece, low, high);
}

// Light below zero is rounding, unless the bars before the piece change its sign.
float rounded_off(Piece piece, float light_of_piece) {
    return piece.changes_sign ? light_of_piece : max(light_of_piece, 0.0);
}

// Light of the piece that lands in the pixel [low, high], as a share of the piece: all of it before the
// detector mask, and what the apertures of that let through beyond the leak of its bars. `home`: the pixel
// that faint light of the piece is put into.
vec2 responses(BeamletGeometry beamlet, Bars bars, Piece piece, float low, float high, bool home) {
    Edge pixel_low = Edge(low, piece.pixel_blur, 0.0);
    Edge pixel_high = Edge(high, piece.pixel_blur, 0.0);
    Mask mask = light.detector_mask;
    bool masked = mask.present != 0u;
    float leak = bars.leak;
    // Only periods with an aperture in reach: where a driver runs every branch, each counts.
    Place place = Place(0, 0u);
    int apertures = 0;
    if (masked && bars.open > 0.0) {
        ivec2 reached = periods_in_reach(mask, bars, beamlet, piece);
        float from = low + beamlet.aperture_offset - bars.reach;
        float to = high + beamlet.aperture_offset + bars.reach;
        ivec2 periods = ivec2(max(reached.x, int(ceil(from / mask.period))),
                              min(reached.y, int(floor(to / mask.period))));
        Reached between = apertures_between(mask, periods, low + beamlet.aperture_offset,
                                            high + beamlet.aperture_offset, bars.reach - outermost(mask));
        place = between.place;
        apertures = between.count;
    }
    float open = 0.0;
    // First the whole pixel, with the bars; then each layer of each aperture. The window is called in
    // the loop once: drivers inline it, and it is long.
    float whole = 0.0;
    uint index = 0u;
    uint layers = 1u;
    int n = leak >= FAINT ? -1 : 0;
    do {
        Edge lower = pixel_low;
        Edge upper = pixel_high;
        bool met = n < 0;
        bool is_last = true;
        float part = 0.0;
        float tilt = bars.leak_tilt;
        if (n >= 0 && n < apertures) {
            Aperture aperture = aperture_of(mask, place);
            float centre = float(place.period) * mask.period - beamlet.aperture_offset;
            if (index == 0u) {
                bool cut = in_soft_edge(bars, aperture, centre, low)
                    || in_soft_edge(bars, aperture, centre, high);
                layers = cut ? bars.cut_layers : bars.layers;
            }
            Layer layer = layer_at(mask, bars, aperture, centre, beamlet.slope, light.analyser, index, layers);
            Edges edges = edges_of(mask, bars, layer, aperture, centre, beamlet.slope, light.analyser,
                                   source_spot(), piece.detector_narrowing);
            index++;
            is_last = index == layers;
            if (is_last) {
                place = next_place(mask, place);
                index = 0u;
            }
            met = edges.high > low && edges.low < high && edges.high > edges.low;
            part = layer.share;
            tilt = bars.open_tilt;
            // Energies for which bars shade more may be displaced more: such light lands farther
            // from one edge, and closer to the other. So does light of an offset of the source
            // for which bars shade more.
#ifdef WALLS
            vec2 covariance = mask.thickness * piece.detector_covariance
                * abs(wall_slopes(mask, beamlet.slope, edges.low, edges.high, light.analyser));
#else
            float covariance = mask.thickness * bars.slope * piece.detector_covariance;
#endif
            SIDES variance = piece.blur * piece.blur + (layer.variance - bars.variance);
            float above = HIGH(variance) + HIGH(covariance) + 2.0 * light.spot * edges.high_turn;
            float below = LOW(variance) - LOW(covariance) - 2.0 * light.spot * edges.low_turn;
            SIDES by_spot = light.spot * light.spot / max(variance, 1e-24);
            if (edges.high < high) {
                upper = Edge(edges.high, sqrt(max(above, 0.0)), HIGH(by_spot) * edges.high_bend);
            }
            if (edges.low > low) {
                lower = Edge(edges.low, sqrt(max(below, 0.0)), LOW(by_spot) * edges.low_bend);
            }
        }
        float share = through_bars(piece, lower, upper, tilt / light.analyser);
        if (n < 0) whole = share;
        else if (met) open += part * share;
        if (is_last) n++;
    } while (n < apertures);
    if (masked && leak < FAINT) {
        // So little that it does not matter where about it lands.
        vec2 passing = between_edges(piece);
        whole = home ? 0.5 * piece.profile.level * max(passing.y - passing.x, 0.0) : 0.0;
    }
    return vec2(whole, open);
}

// Light of the piece that passes the detector mask and lands in the pixel, as a share of the piece.
float response(BeamletGeometry beamlet, Bars bars, Piece piece, float low, float high, bool home) {
    vec2 parts = responses(beamlet, bars, piece, low, high, home);
    if (light.detector_mask.present == 0u) return rounded_off(piece, parts.x);
    return rounded_off(piece, bars.leak < NEGLIGIBLE ? parts.y : bars.leak * parts.x + parts.y);
}

// Displacements that change faster than this along x go on like that no farther than their cell.
float steepest() {
    return 0.5 * light.magnification;
}

// Growth of light from the cell plane to the analyser about an edge of an aperture: displacements that change faster
// than `steepest` go on no farther than their cell.
float steady_growth(float displacement_slope) {
    return light.magnification + (abs(displacement_slope) < steepest() ? displacement_slope : 0.0);
}

// The part [a, b] of a cell on the analyser. x is the place in the cell plane of the ray from the centre
// of the source through the same point of the sample: the effect of the sample depends on it alone.
// `soft`: variance added by the shadows of thick bars, of the sample mask in the cell plane and of the
// detector mask on the analyser. `tilt`: of the transmission, share of it per m.
Piece piece_of(CellRow cell_row, Cell cell, float a, float b, float transmission, float tilt, vec2 soft) {
    float span = cell.x_high - cell.x_low;
    float depth_slope = (cell.depth_high - cell.depth_low) / span;
    float displacement_slope = (cell.displacement_high - cell.displacement_low) / span;
    float middle = 0.5 * (a + b);
    float width = b - a;
    float from_low = middle - cell.x_low;
    float growth = light.magnification + displacement_slope;
    float depth_change = depth_slope * width;
    float level = 1.0 + tilt * middle;
    Piece piece;
    piece.amount = transmission * mean_passed(cell.depth_low + depth_slope * from_low, depth_change) * width
        * light.weight * (cell_row.bottom - cell_row.top);
    piece.middle = light.magnification * middle + cell.displacement_low + displacement_slope * from_low;
    piece.half_width = 0.5 * growth * width;
    // Soft edges of the aperture move light as if the bend extended over all of it.
    float steady = steady_growth(displacement_slope);
    float shadow = steady * steady * soft.x;
    float variance = shadow + cell.displacement_variance;
    piece.blur = sqrt(light.spot * light.spot + soft.y + variance);
    piece.pixel_blur = sqrt(light.pixel_spot * light.pixel_spot + variance);
    piece.pixel_shift = cell.pixel_shift;
    piece.by_spot = light.spot / max(piece.blur, 1e-12);
    float turn = tilt * source_spot() * (light.cell_plane / light.rotation_distance) * piece.by_spot;
    piece.profile = Profile(level, 0.5 * (level * linear_change(depth_change) - tilt * width), -turn);
    piece.changes_sign = abs(level - 1.0) + 0.5 * abs(tilt) * width + 6.0 * abs(turn) > 1.0;
    piece.detector_narrowing = cell.detector_narrowing;
    piece.sample_covariance = SIDES(0.0);
    piece.detector_covariance = cell.detector_covariance;
    piece.steep_low = piece.steep_high = STEEP;
    piece.low = -STEEP - BEYOND;
    piece.high = STEEP + BEYOND;
    piece.low_bend = piece.high_bend = 0.0;
    return piece;
}

// Shifts of both edges of an aperture of the sample mask per standard deviation of the landing place, m in the cell
// plane. An offset of the source moves edge and landing place; roughness, energies and soft edges of the sample mask
// blur the landing place alone. A window has one random number for both: with these shifts light at an edge lands with
// the variance of independent parts, (source + by_source)^2 + blur^2 - source^2. `by_source`: shifts per deviation of
// the source offset; `source`, `blur`: deviations of the landing place by the source and by all, over the growth of
// light; `more`: variance of each edge that `blur` lacks.
vec2 shifts_of(vec2 by_source, float source, float blur, vec2 more) {
    vec2 gain = by_source * (2.0 * source + by_source) + more;
    return gain / max(sqrt(max(gain + blur * blur, 0.0)) + blur, 1e-30);
}

// Lets an aperture of the sample mask cut the piece [a, b]; `shifts`: of its edges against the piece per standard
// deviation of the landing place.
void cut_by(inout Piece piece, float a, float b, Edges edges, vec2 shifts) {
    float middle = 0.5 * (a + b);
    float half_cell = 0.5 * (b - a);
    vec2 per = 1.0 / max(shifts, half_cell / STEEP);
    piece.steep_low = half_cell * per.x;
    piece.steep_high = half_cell * per.y;
    float most_low = piece.steep_low + BEYOND;
    float most_high = piece.steep_high + BEYOND;
    piece.low = clamp((edges.low - middle) * per.x, -most_low, most_low);
    piece.high = clamp((edges.high - middle) * per.y, -most_high, most_high);
    piece.low_bend = edges.low_bend * per.x;
    piece.high_bend = edges.high_bend * per.y;
}
