// Masks in the way of a cell row: at all steps, at one step, and in one layer of one aperture.

// The part of a cell row that this invocation illuminates, the whole cell row, its beamlet, and the bars of
// sample and detector mask before it.
CellRowPart part;
CellRow cell_row;
BeamletGeometry beamlet;
Bars bars;
Bars bars_behind;

// What else is the same for all steps and cells of the cell row.
struct Setting {
    vec2 soft;     // variance of the soft edges of both masks
    float faint;   // light that stays in its pixel
    bool leaks;    // bars of the sample mask let light through that is summed once for all steps
    bool sharp;    // a source without extent, or cells in the plane of the mask
    float reach;   // of the blur about an edge of the sample mask, in the cell plane
    Aperture ends; // of its cells
    // Range of its light on the analyser, relative to its own place.
    float low_landing;
    float high_landing;
};

Setting setting;

// Thresholds for the rounding of light that lands in a pixel: spread evenly over [0, 1), and the same
// for a cell row whatever is computed beside it.
vec3 rounding_thresholds(int pixel) {
    uvec3 place = floatBitsToUint(vec3(setting.ends.low, cell_row.top, cell_row.bottom));
    uvec3 bits = pcg4d(uvec4(place, uint(pixel - beamlet.pixel))).xyz;
    return vec3(below_one(bits.x), below_one(bits.y), below_one(bits.z));
}

// The beamlet of the cell row, at this offset of the source.
void beamlet_begin() {
    beamlet = BeamletTable(light.beamlets).at[cell_row.column];
    beamlet.sample_offset += light.mask_shift;
    beamlet.aperture_offset -= light.landing_shift;
    beamlet.pixel_offset -= light.pixel_shift;
    beamlet.slope -= light.slope_shift;
}

// Slope dz/dy under which a row sees the bars: rows of a block see them under one angle.
float slope_of_rows() {
    float block = (floor(float(cell_row.row) / light.alike_rows) + 0.5) * light.alike_rows;
    return (block - light.middle_row) * light.row_slope;
}

// Leaks of the sample mask below this are added to one pixel for each period: where the period is wider than a pixel,
// fewer leaks are.
float faintest_leak() {
    return FAINT * min(light.pixel_pitch / (light.sample_mask.period * light.magnification), 1.0);
}

// Light through faint bars of the sample mask.
float faint_light() {
    float faint = 0.0;
    if (light.sample_mask.present != 0u && bars.leak > NEGLIGIBLE && bars.leak < faintest_leak()) {
        Mask behind = light.detector_mask;
        faint = bars.leak * cell_row.light * light.weight * (cell_row.bottom - cell_row.top)
            * (bars_behind.leak
               + bars_behind.open * (behind.present != 0u ? open_part(behind) : 1.0));
    }
    return faint;
}

// Bars of the sample mask under this slope.
Bars bars_before(float slope) {
    float behind_blur = light.detector_mask.present != 0u ? light.spot : light.pixel_spot;
    return bars_of(light.sample_mask, slope, secant(slope, slope_of_rows()),
                   behind_blur / light.magnification);
}

void setting_begin() {
    beamlet_begin();
    float sec = secant(beamlet.slope, slope_of_rows());
    bars = bars_before(beamlet.slope);
    bars_behind = bars_of(light.detector_mask, beamlet.slope, sec, light.spot);
    if (bars_behind.depth > 0.0) {
        // The spot does not blur the edges of pixels against the edges of the mask.
        bars_behind.cut_layers = layers_of(bars_behind, light.detector_mask.period, 0.0);
    }
    beamlet.sample_offset -= bars.lattice_shift;
    beamlet.aperture_offset -= bars_behind.lattice_shift;
    setting.soft = vec2(bars.variance, bars_behind.variance);
    setting.faint = faint_light();
    setting.leaks = light.sample_mask.present != 0u && bars.leak >= faintest_leak();
    setting.sharp = light.mask_blur <= 0.0;
    setting.reach = 6.5 * light.mask_blur;
#ifdef WALLS
    // Edges of an aperture differ in their blur.
    setting.sharp = setting.sharp && bars.variance <= 0.0;
    setting.reach += 6.5 * sqrt(bars.variance);
#endif
    setting.ends = Aperture(push.cells.at[cell_row.first_cell].x_low,
                            push.cells.at[cell_row.first_cell + cell_row.cell_count - 1u].x_high);
    float growth = light.magnification + min(cell_row.displacement_slope, steepest());
    float blur = max(light.spot * light.spot + setting.soft.y, light.pixel_spot * light.pixel_spot);
    blur = sqrt(blur + growth * growth * setting.soft.x + cell_row.displacement_variance);
    setting.low_landing = cell_row.low_landing + beamlet.pixel_offset - 6.5 * blur;
    setting.high_landing = cell_row.high_landing + beamlet.pixel_offset + 6.5 * blur;
}

// A mask step of a cell row; behind the last step the light common to all.
struct Exposed {
    bool at_all_steps;
    float offset;   // of the sample mask against the beamlet
    Place from;     // first aperture in reach
    int apertures;  // that are in reach
    ivec2 pixels;   // first and last that light may reach, from the beamlet's own
};

Exposed exposed_at(uint mask_step) {
    Exposed step_ = Exposed(mask_step == push.steps, 0.0, Place(0, 0u), 0, ivec2(0));
    Mask mask = light.sample_mask;
    vec2 lit = vec2(setting.ends.low, setting.ends.high);
    if (!step_.at_all_steps && bars.open > 0.0) {
        step_.offset = Offsets(light.offsets).at[mask_step] - beamlet.sample_offset;
        float edge = bars.reach + setting.reach;
        int from = int(ceil((setting.ends.low - step_.offset - edge) / mask.period));
        int to = int(floor((setting.ends.high - step_.offset + edge) / mask.period));
        Reached reached = apertures_between(mask, ivec2(from, to), setting.ends.low - step_.offset,
                                            setting.ends.high - step_.offset, edge - outermost(mask));
        step_.from = reached.place;
        step_.apertures = reached.count;
        lit.x = max(lit.x, float(from) * mask.period + step_.offset - edge);
        lit.y = min(lit.y, float(to) * mask.period + step_.offset + edge);
    }
    if (lit.y > lit.x) {
        float low = light.magnification * lit.x + setting.low_landing;
        float high = light.magnification * lit.y + setting.high_landing;
        step_.pixels = ivec2(int(floor(low / light.pixel_pitch + 0.5)),
                             int(floor(high / light.pixel_pitch + 0.5)));
    }
    if (setting.faint > 0.0) {
        step_.pixels.x = min(step_.pixels.x, 0);
        step_.pixels.y = max(step_.pixels.y, 0);
    }
    // Far outside the detector there is nothing to sum.
    step_.pixels.x = max(step_.pixels.x, -beamlet.pixel);
    step_.pixels.y = min(step_.pixels.y, int(light.column_count) - 1 - beamlet.pixel);
    return step_;
}

// Opening for the light of cells: a layer of an aperture of the sample mask, or all leaking bars.
struct Opening {
    bool cuts; // not of what bars leak
    float tilt; // of its light, share of it per m in the cell plane
    Layer layer;
    Aperture aperture;
    float centre;
    uint first;   // cell that it lets light through of, the count where there is none
    float beyond; // cells from here on get none
};

Opening leak_of() {
    return Opening(false, bars.leak_tilt / light.cell_plane, Layer(bars.leak, 0.0, SIDES(0.0), SIDES(0.0), SIDES(0.0)),
                   Aperture(0.0, 0.0), 0.0, 0u, 1e30);
}

Edges edges_in(Opening opening, float narrowing) {
    return edges_of(light.sample_mask, bars, opening.layer, opening.aperture, opening.centre,
                    beamlet.slope, light.cell_plane, source_spot(), narrowing);
}

// The first cell that ends beyond x; cells are sorted.
uint cell_beyond(float x) {
    uint first = 0u;
    uint last = cell_row.cell_count;
    do {
        uint middle = (first + last) / 2u;
        bool beyond = push.cells.at[cell_row.first_cell + middle].x_high > x;
        last = beyond ? middle : last;
        first = beyond ? first : middle + 1u;
    } while (first < last);
    return first;
}

// Middle of a period, m in the cell plane from the middle of the beamlet.
float centre_of(Exposed step_, int period) {
    return float(period) * light.sample_mask.period + step_.offset;
}

// Whether apertures of the period about `centre` reach beyond the cells into a neighbouring beamlet.
// Both beamlets must see the period alike: under the angle of its middle.
bool is_shared(float centre) {
    float reach = bars.reach + setting.reach;
    return bars.depth > 0.0 && (centre - reach < setting.ends.low || centre + reach > setting.ends.high);
}

// Slope of a ray through the middle of a period.
float slope_at(float centre) {
    return beamlet.slope + centre / light.cell_plane;
}

// Layers of the apertures of a period.
uint layers_at(float centre) {
    return is_shared(centre) ? bars_before(slope_at(centre)).layers : bars.layers;
}

// A layer of the `layers` of the aperture at `place`.
Opening opening_of(Exposed step_, Place place, uint layer, uint layers) {
    float centre = centre_of(step_, place.period);
    Aperture aperture = aperture_of(light.sample_mask, place);
    Layer own = layer_at(light.sample_mask, bars, aperture, centre, beamlet.slope, light.cell_plane, layer, layers);
    Opening opening = Opening(true, bars.open_tilt / light.cell_plane, own, aperture, centre, 0u, 0.0);
#ifndef WALLS
    if (is_shared(centre)) {
        float grown = max(1.0 + bars.stretch * (abs(slope_at(centre)) - bars.slope), 0.0);
        opening.layer.variance *= grown * grown;
    }
#endif
    // Of the cells of averaged masks it is narrower.
    Edges widest = edges_in(opening, 0.0);
    opening.first = cell_beyond(widest.low - setting.reach);
    opening.beyond = widest.high + setting.reach;
    return opening;
}

void add_to_pixel(int row, int pixel, uint mask_step, uvec2 value) {
    uint index;
    if (value == uvec2(0u) || !place_of_light(light, row, pixel, mask_step, index)) return;
    add_words(push.sums, index, value);
}
