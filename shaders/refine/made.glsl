// Cells of rectangles, as the kernels of light take them.

// Blur of rows from which on light goes beyond the rows beside, share of a row.
const float WIDE = 1.0 / 6.0;
// Standard deviations that a blur reaches.
const float BLURS = 6.0;

// Share of light spread evenly over [low, high] and blurred that lies before a border.
float share_before(float border, float low, float high) {
    float blur = P.row_blur;
    if (blur <= 0.0) return clamp((border - low) / (high - low), 0.0, 1.0);
    float near = (border - high) / blur;
    float far = (border - low) / blur;
    if (far - near > 0.25) return clamp((ramp(far) - ramp(near)) / (far - near), 0.0, 1.0);
    // The difference would lose its digits: Simpson's rule.
    float density, a, b, c;
    normal(near, density, a);
    normal(0.5 * (near + far), density, b);
    normal(far, density, c);
    return (a + 4.0 * b + c) / 6.0;
}

// Where the light of a rectangle lands: rows beside its own, and whether these take all of it.
struct Rows {
    float low;
    float high;
    bool is_near;
    float above;
    float below;
};

// Rows that light of a rectangle reaches; `landing`: displacement along z on the detector.
Rows rows_of(Rectangle g, float landing) {
    float down = -landing / P.row_pitch;
    Rows rows = Rows(g.z_low + down, g.z_high + down, false, -1.0, 0.0);
    float reach = BLURS * P.row_blur;
    rows.is_near = P.row_blur <= WIDE && rows.low - reach >= -1.0 && rows.high + reach <= 2.0;
    if (rows.is_near) {
        rows.above = share_before(0.0, rows.low, rows.high);
        rows.below = min(1.0 - share_before(1.0, rows.low, rows.high), 1.0 - rows.above);
    }
    return rows;
}

// Standard deviations that a blur reaches behind apertures that end along z.
const float BLURS_OF_HEIGHTS = 6.5;

// Whether light of the cell of a rectangle may land in a wanted row.
bool is_wanted(Rectangle g, RefinedPatch patch_, Cell cell) {
    float row = float(patch_.row) - cell.displacement_z / P.row_pitch;
    float reach = BLURS * P.row_blur;
    if (has_heights()) reach = BLURS_OF_HEIGHTS * P.row_blur + 0.5 * abs(cell.share_above);
    return row + g.z_high + reach >= float(P.wanted[0]) && row + g.z_low - reach <= float(P.wanted[1]);
}

// Counts light that lands too far off to be followed.
void count_landing(float landing) {
    if (abs(landing / P.row_pitch) > P.halo) atomicAdd(P.head.at[HEAD_LANDED_OFF], 1u);
}

// A rectangle of a run; of a patch that misses the sample the whole patch.
Rectangle rectangle_at(uint index) {
    Rectangle g = P.rectangles.at[index];
    if (is_hit(g.patch_index)) return g;
    g.x_low = -0.5 * P.period;
    g.x_high = 0.5 * P.period;
    g.z_low = 0.0;
    g.z_high = 1.0;
    return g;
}

// Shift of pixel edges on the analyser.
float shift_of(float displacement, float slope_x) {
    return displacement * (1.0 - P.ratio) - slope_x * P.gap * P.ratio;
}

// The slope along x of the ray of a rectangle, by its shift.
float slope_of(Rectangle g) {
    float turned = g.displacement * (1.0 - P.ratio) - g.pixel_shift;
    return P.gap > 0.0 ? turned / (P.gap * P.ratio) : 0.0;
}

// Light of a cell, as a length of the open beam.
float light_of(Cell cell) {
    float rise = cell.depth_high - cell.depth_low;
    float middle = exp(-0.5 * (cell.depth_low + cell.depth_high));
    return (cell.x_high - cell.x_low) * middle * (1.0 + rise * rise / 24.0);
}

// Optical depth of a cell without light.
const float NO_LIGHT = 200.0;

Cell no_cell(Rectangle g) {
    return Cell(g.x_low, g.x_high, NO_LIGHT, NO_LIGHT, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
}

// A row of cells that is being made.
struct Made {
    uint first; // its first cell
    uint count;
    bool is_near;
    float light;
    vec2 landing; // least and greatest displacement, against the edges of pixels
    float variance; // largest of a cell
    float slope; // largest change of the displacement per metre
};

Made made_from(uint first) {
    return Made(first, 0u, true, 0.0, vec2(1e30, -1e30), 0.0, 0.0);
}

bool has_light(Cell cell) {
    return cell.depth_low < NO_LIGHT;
}

// Takes the next cell into a row.
void take_cell(inout Made made, Cell cell) {
    made.count++;
    made.is_near = made.is_near && cell.share_above >= 0.0;
    made.light += light_of(cell);
    float low = min(cell.displacement_low, cell.displacement_high) - cell.pixel_shift;
    float high = max(cell.displacement_low, cell.displacement_high) - cell.pixel_shift;
    made.landing = vec2(min(made.landing.x, low), max(made.landing.y, high));
    made.variance = max(made.variance, cell.displacement_variance);
    float rise = abs(cell.displacement_high - cell.displacement_low);
    made.slope = max(made.slope, rise / (cell.x_high - cell.x_low));
}

CellRow row_of(Made made, Rectangle g, RefinedPatch patch_) {
    return CellRow(made.first, made.count, patch_.column, patch_.row, g.z_low, g.z_high, 1u, made.light,
                   made.landing.x, made.landing.y, made.variance, made.slope);
}
