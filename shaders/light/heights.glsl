// Masks whose apertures end along z, as strips: intervals of z with the same apertures along x. The light of
// a cell behind a strip of the sample mask and a strip of the detector mask is the product of an integral
// along x, as behind slits, and of the same integral along z, over the height of the cell and the offset of
// the source (docs/developers/numerics.md, "Apertures that end along z"). Lengths along z are rows on the detector,
// downwards from the upper end of the row of the cells.

// In place of the index of a strip: light that no edges along z cut.
const uint NO_STRIP = 0xffffffffu;

HeightParams heights;
RowGeometry row_geometry;
// Strip of the sample mask in work, and its displacement along z at the mask step.
uint sample_strip;
float sample_step;
// Width of the shadow of the bars along z.
vec2 shadow_z;
// Light through faint bars at each mask step.
float faint_of_row;

void heights_begin() {
    heights = HeightParamsRef(light.heights).at[0];
    row_geometry = RowTable(heights.rows).at[cell_row.row - heights.first_row];
    float slope = abs((float(cell_row.row) + 0.5 * (cell_row.top + cell_row.bottom) - light.middle_row)
                      * light.row_slope);
    shadow_z = slope * vec2(heights.sample_mask.thickness, heights.detector_mask.thickness);
    sample_strip = NO_STRIP;
    sample_step = 0.0;
    faint_of_row = setting.faint;
}

// Strips of the sample mask at a mask step; one for the light that its bars leak, or of slits.
uint sample_strips(uint mask_step) {
    return mask_step == push.steps ? 1u : max(heights.sample_mask.count, 1u);
}

// A mask of slits with the apertures of a strip.
Mask mask_of_strip(Mask mask, MaskHeights of, uint strip) {
    mask.apertures = MaskStrips(of.strips).at[strip].apertures;
    mask.count = MaskStrips(of.strips).at[strip].count;
    mask.first = Apertures(mask.apertures).at[0].low;
    mask.last = MaskStrips(of.strips).at[strip].last;
    return mask;
}

// Gives the sample mask the apertures of a strip.
void take_sample_strip(uint strip, uint mask_step) {
    bool cuts = mask_step != push.steps && heights.sample_mask.count > 0u;
    sample_strip = cuts ? strip : NO_STRIP;
    // Faint leaks are summed once.
    setting.faint = strip == 0u ? faint_of_row : 0.0;
    if (!cuts) return;
    sample_step = Offsets(heights.offsets).at[mask_step];
    light.sample_mask = mask_of_strip(light.sample_mask, heights.sample_mask, strip);
}

// Distance that light of a cell lands below its place on the detector, rows.
float landed_below(Cell cell) {
    return light.row_shift - cell.displacement_z / light.row_pitch;
}

// Light of a cell along z on the detector, as a piece across the whole height.
Piece piece_along_z(Cell cell, float low, float high) {
    float height = cell_row.bottom - cell_row.top;
    float middle = 0.5 * (low + high);
    float from_middle = middle - 0.5 * (cell_row.top + cell_row.bottom);
    float growth = 1.0 + cell.share_above / height;
    float tilt = cell.share_below / height;
    float shadow = growth * growth * shadow_z.x * shadow_z.x * heights.sample_mask.variance;
    Piece piece;
    piece.passes = true;
    piece.amount = (high - low) / height;
    piece.middle = middle + landed_below(cell)
        + cell.share_above / height * from_middle;
    piece.half_width = 0.5 * growth * (high - low);
    piece.pixel_blur = sqrt(light.row_blur * light.row_blur + shadow);
    piece.blur = sqrt(heights.analyser_blur * heights.analyser_blur + shadow
                      + shadow_z.y * shadow_z.y * heights.detector_mask.variance);
    piece.pixel_shift = 0.0;
    piece.by_spot = 0.0;
    piece.profile = Profile(1.0 + tilt * from_middle, -0.5 * tilt * (high - low), 0.0);
    piece.changes_sign = false;
    piece.detector_narrowing = 0.0;
    piece.sample_covariance = 0.0;
    piece.detector_covariance = 0.0;
    piece.steep_low = piece.steep_high = STEEP;
    piece.low = -STEEP - BEYOND;
    piece.high = STEEP + BEYOND;
    piece.low_bend = piece.high_bend = 0.0;
    return piece;
}

// Displacement of an edge into the aperture, in rows. `narrowing`: share of the shadow, of averaged masks.
float inset_of(Mask mask, MaskHeights of, float shadow, float narrowing) {
    return shadow * (mask.averaged != 0u ? 0.5 * narrowing : of.inset);
}

// Upper and lower end of a strip in a period from the row. The shadows of bars move the outline of an aperture
// towards its middle, and with it the borders between its strips.
vec2 ends_of(MaskHeights of, uint strip, float centre, float inset) {
    float top = MaskStrips(of.strips).at[strip].top;
    float bottom = MaskStrips(of.strips).at[strip].bottom;
    float middle = MaskStrips(of.strips).at[strip].middle;
    vec2 ends = vec2(top + inset, bottom - inset);
    if (bottom <= middle) ends = min(vec2(top, bottom) + inset, middle);
    if (top >= middle) ends = max(vec2(top, bottom) - inset, middle);
    return centre + ends;
}

// The part of the light of a cell along z that the strip of the sample mask in work leaves between two ends; all of
// it where no strip cuts.
Piece through_ends(Cell cell, vec2 ends) {
    bool cuts = sample_strip != NO_STRIP;
    bool sharp = heights.mask_blur <= 0.0;
    float low = cell_row.top;
    float high = cell_row.bottom;
    float reach = 6.5 * heights.mask_blur;
    if (cuts && sharp) {
        low = max(low, ends.x);
        high = min(high, ends.y);
    }
    bool passes = !cuts
        || (ends.y > ends.x && ends.y + reach > low && ends.x - reach < high && high > low);
    Piece piece = piece_along_z(cell, low, passes ? high : low + 1.0);
    piece.passes = passes;
    if (cuts && passes && !sharp && (ends.x + reach > low || ends.y - reach < high)) {
        float slope = cell.share_above / (cell_row.bottom - cell_row.top);
        float growth = abs(slope) < 0.5 ? 1.0 + slope : 1.0;
        float source = light.row_blur;
        float blur = piece.pixel_blur;
        if (heights.detector_mask.count > 0u) {
            float soft = shadow_z.y * shadow_z.y * heights.detector_mask.variance;
            source = sqrt(heights.analyser_blur * heights.analyser_blur + soft);
            blur = piece.blur;
        }
        vec2 shifts = shifts_of(vec2(heights.mask_blur), source / growth, blur / growth, vec2(0.0));
        cut_by(piece, low, high, Edges(ends.x, ends.y, 0.0, 0.0, 0.0, 0.0), shifts);
    }
    return piece;
}

// Share of a piece along z that lands between two edges on the detector.
float landing_share(Piece piece, Edge low, Edge high) {
    // An edge beside all of the light leaves none of it, however soft the other edge is. The difference of the shares at
    // both edges would be rounding.
    float half_width = abs(piece.half_width);
    if (!(high.at > low.at) || high.at + 6.5 * high.blur <= piece.middle - half_width
        || low.at - 6.5 * low.blur >= piece.middle + half_width) return 0.0;
    return piece.amount * max(window(piece, low, high), 0.0);
}

// Periods of a mask, in order, whose strip overlaps the rows from `low` to `high`; `begin`: centre of a period.
ivec2 periods_of(MaskHeights of, uint strip, float begin, float low, float high) {
    float top = begin + MaskStrips(of.strips).at[strip].top;
    float bottom = begin + MaskStrips(of.strips).at[strip].bottom;
    return ivec2(int(ceil((low - bottom) / of.period)), int(floor((high - top) / of.period)));
}

// Centre of a period of the sample mask at the mask step.
float sample_begin() {
    return row_geometry.sample_offset + sample_step + heights.mask_shift;
}

// Periods whose strip of the sample mask in work light of the cell row may pass.
ivec2 sample_periods() {
    float reach = 6.5 * heights.mask_blur + shadow_z.x;
    return periods_of(heights.sample_mask, sample_strip, sample_begin(), cell_row.top - reach,
                      cell_row.bottom + reach);
}

// Centre of a period of the detector mask, as light of a cell reaches it: it is displaced less on the mask than on the
// detector.
float begin_behind(Cell cell) {
    float down = cell.displacement_z / light.row_pitch;
    return row_geometry.aperture_offset + light.row_shift - down
        - (heights.analyser_shift - heights.analyser_share * down);
}

// Share of the light of a cell along z that passes the strip of the sample mask in work and a strip of the
// detector mask, and lands in a row. The window is called in the loop once, as in `responses`.
float share_along_z(Cell cell, uint strip, int row) {
    bool cuts = sample_strip != NO_STRIP;
    bool ends_behind = strip != NO_STRIP;
    float upper = float(row);
    float lower = upper + 1.0;
    ivec2 periods = ivec2(0);
    float inset = 0.0;
    if (cuts) {
        periods = sample_periods();
        inset = inset_of(light.sample_mask, heights.sample_mask, shadow_z.x, cell.sample_narrowing);
    }
    float begin = begin_behind(cell);
    ivec2 periods_behind = ivec2(0);
    float inset_behind = 0.0;
    if (ends_behind) {
        inset_behind = inset_of(light.detector_mask, heights.detector_mask, shadow_z.y,
                                cell.detector_narrowing);
        periods_behind = periods_of(heights.detector_mask, strip, begin, upper - inset_behind,
                                    lower + inset_behind);
    }
    if (periods.y < periods.x || periods_behind.y < periods_behind.x) return 0.0;
    float sum = 0.0;
    int k = periods.x;
    int l = periods_behind.x;
    Piece piece;
    do {
        if (l == periods_behind.x) {
            vec2 ends = vec2(0.0);
            if (cuts) {
                ends = ends_of(heights.sample_mask, sample_strip,
                               sample_begin() + float(k) * heights.sample_mask.period, inset);
            }
            piece = through_ends(cell, ends);
        }
        Edge low = Edge(upper, piece.pixel_blur, 0.0);
        Edge high = Edge(lower, piece.pixel_blur, 0.0);
        if (ends_behind) {
            vec2 ends = ends_of(heights.detector_mask, strip,
                                begin + float(l) * heights.detector_mask.period, inset_behind);
            if (ends.x > upper) low = Edge(ends.x, piece.blur, 0.0);
            if (ends.y < lower) high = Edge(ends.y, piece.blur, 0.0);
        }
        if (piece.passes) sum += landing_share(piece, low, high);
        bool is_last = l == periods_behind.y;
        l = is_last ? periods_behind.x : l + 1;
        k = is_last ? k + 1 : k;
    } while (k <= periods.y);
    return sum;
}

// First and last row of the band that light of a cell reaches.
ivec2 rows_reached(Cell cell) {
    float shift = landed_below(cell);
    float reach = 6.5 * light.row_blur + 0.5 * abs(cell.share_above);
    float first = float(light.first_row - cell_row.row);
    float end = first + float(light.row_count);
    float top = floor(cell_row.top + shift - reach);
    float bottom = floor(cell_row.bottom + shift + reach);
    return ivec2(clamp(top, first, end), clamp(bottom, first - 1.0, end - 1.0));
}

// Shares of rows that are kept while light of a cell goes to pixels: of some rows that it reaches, behind one strip of
// the detector mask. Each is computed once, whatever the number of pixels.
const int ROWS_KEPT = 16;
float kept_even[ROWS_KEPT];
float kept_cut[ROWS_KEPT];
ivec2 reached; // first and last row
ivec2 kept; // the same of those kept
uint kept_strip;
// Those that are kept next.
uint next_strip = NO_STRIP;
int next_row;

bool shares_left() {
    return next_strip < max(heights.detector_mask.count, 1u);
}

void shares_begin(Cell cell) {
    reached = rows_reached(cell);
    next_strip = 0u;
    next_row = reached.x;
}

// True if a strip of the detector mask lies before the rows that light of a cell reaches.
bool strip_is_behind(Cell cell, uint strip) {
    float inset = inset_of(light.detector_mask, heights.detector_mask, shadow_z.y, cell.detector_narrowing);
    ivec2 periods = periods_of(heights.detector_mask, strip, begin_behind(cell), float(reached.x) - inset,
                               float(reached.y + 1) + inset);
    return periods.x <= periods.y;
}

// Light behind bars and slits, which are alike along z. The first strip carries it, too.
bool has_even_light() {
    return kept_strip == 0u && (heights.detector_mask.count == 0u || bars_behind.leak >= NEGLIGIBLE);
}

// Keeps the next shares; false where none of the light passes.
bool keep_shares(Cell cell) {
    uint strips = heights.detector_mask.count;
    bool any = false;
    while (!any && shares_left()) {
        kept_strip = next_strip;
        kept = ivec2(next_row, min(next_row + ROWS_KEPT - 1, reached.y));
        bool passes = kept_strip == 0u || strip_is_behind(cell, kept_strip);
        int end = passes ? 2 * (kept.y - kept.x + 1) : 0;
        for (int n = 0; n < end; n++) {
            bool even = (n & 1) == 0;
            bool none = even ? !has_even_light() : strips == 0u;
            float share = none ? 0.0 : share_along_z(cell, even ? NO_STRIP : kept_strip, kept.x + (n >> 1));
            if (even) kept_even[n >> 1] = share;
            else kept_cut[n >> 1] = share;
            any = any || share != 0.0;
        }
        bool is_last = !passes || kept.y == reached.y;
        next_row = is_last ? reached.x : kept.y + 1;
        next_strip += is_last ? 1u : 0u;
    }
    if (any && strips > 0u) {
        light.detector_mask = mask_of_strip(light.detector_mask, heights.detector_mask, kept_strip);
    }
    return any;
}

// True if light of the cell row may pass the strip of the sample mask in work.
bool strip_meets() {
    if (sample_strip == NO_STRIP) return true;
    ivec2 periods = sample_periods();
    return periods.x <= periods.y;
}

// Where light of a cell row goes at one mask step.
struct Landing {
    uint mask_step;
};

// Adds light in a row, counted from that of the cells, to each row of the cell row.
void add_in_row(Landing landing, int row, int pixel, float value) {
    if (!(abs(value) < 1e30)) value = 0.0;
    uvec2 words = fixed_point(value, rounding_thresholds(pixel).x);
    add_to_pixel(cell_row.row + row, pixel, landing.mask_step, words);
}

// `faint`: light that stays in its pixel; `pixels`: the first and last that light may reach.
Landing landing_begin(uint mask_step, float faint, ivec2 pixels) {
    Landing landing = Landing(mask_step);
    if (faint > 0.0) add_in_row(landing, 0, beamlet.pixel, faint);
    return landing;
}

// Light of a piece of a cell lands in a pixel, whose lower edge is `edge`, and in the rows kept.
void land_in_rows(Landing landing, Piece piece, int pixel, float edge, bool home) {
    vec2 parts = responses(beamlet, bars_behind, piece, edge, edge + light.pixel_pitch, home);
    bool cuts = heights.detector_mask.count > 0u;
    float even = bars_behind.leak >= NEGLIGIBLE ? bars_behind.leak * parts.x : 0.0;
    if (!cuts && light.detector_mask.present != 0u) even += parts.y;
    even = has_even_light() ? piece.amount * rounded_off(piece, even) : 0.0;
    float cut = cuts ? piece.amount * rounded_off(piece, parts.y) : 0.0;
    if (even == 0.0 && cut == 0.0) return;
    for (int row = kept.x; row <= kept.y; row++) {
        float value = even * kept_even[row - kept.x] + cut * kept_cut[row - kept.x];
        if (value != 0.0) add_in_row(landing, row, beamlet.pixel + pixel, value);
    }
}

void landing_end(Landing landing) {}
