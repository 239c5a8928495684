#version 460
// Light of cells: one invocation per strip and mask step integrates every cell over the sample
// mask, the focal spot, the detector mask and the pixels (docs/physics.md, "Cells").
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform IlluminatePush {
    LightRef light_ref;
    Strips strips;
    Cells cells;
    Words sums; // [step][row][column][2]
    uint strip_count;
    uint first_strip;
    uint first_step;
    uint repeats; // steps from the first that see the same light
} push;

#include "physics/gauss.glsl"
#include "physics/polygon.glsl"
#include "light/sum.glsl"
#include "light/mask.glsl"

const float NEGLIGIBLE = 1e-9; // leaks below this are left out
const float FAINT = 1e-4;      // the light of leaks below this is spread over the whole strip

// Light waiting for one pixel in three rows, so that sums meet memory once per pixel.
struct Pending {
    int pixel;
    vec3 rows; // row - 1, row, row + 1
};

// Adds light to a pixel at every step that sees the same.
void add_to_steps(Light light, int row, int pixel, uint mask_step, float value) {
    uint index;
    if (!(value > 0.0) || !place_of_light(light, row, pixel, mask_step, index)) return;
    uint frame = light.row_count * light.column_count;
    for (uint n = 0u; n < push.repeats; n++) add_light(push.sums, index + n * frame, value);
}

void flush(Light light, int row, uint mask_step, inout Pending pending) {
    for (int i = 0; i < 3; i++) {
        add_to_steps(light, row - 1 + i, pending.pixel, mask_step, pending.rows[i]);
    }
    pending.rows = vec3(0.0);
}

// How the light of a cell spreads over rows.
struct RowSpread {
    float middle;
    float half_height;
    bool near; // within the row and its two neighbours
    vec3 shares;
};

RowSpread row_spread(Light light, Strip strip, Cell cell) {
    RowSpread spread;
    spread.middle = 0.5 * (strip.top + strip.bottom) - cell.displacement_z / light.row_pitch
        + light.row_move;
    spread.half_height = 0.5 * (strip.bottom - strip.top);
    spread.near = cell.above >= 0.0;
    spread.shares = vec3(cell.above, 1.0 - cell.above - cell.below, cell.below);
    if (light.rows_apart != 0u) {
        float span = spread.half_height + 6.0 * light.row_blur;
        spread.near = spread.middle - span >= -1.0 && spread.middle + span <= 2.0;
        float above = share_below(0.0, spread.middle, spread.half_height, light.row_blur);
        float below = 1.0 - share_below(1.0, spread.middle, spread.half_height, light.row_blur);
        spread.shares = vec3(above, 1.0 - above - below, below);
    }
    return spread;
}

// Light of a cell, or of what a hard edge leaves of it, on the analyser: evenly spread over
// middle +- half_width, blurred by the spot.
struct Piece {
    float amount;
    float middle;
    float half_width; // signed: light may land in reverse order
    float blur;       // at edges of the detector mask
    float pixel_blur; // at edges of pixels
    float pixel_shift;
    float lean;       // half the change of optical depth over the piece
    float detector_shade;
    // Where the aperture of the sample mask cuts the piece the cut depends on the source offset
    // t (in standard deviations): half_cell * xi + shift * t lies in [aperture_low, aperture_high].
    bool cut;
    float half_cell;
    float shift;
    float aperture_low;
    float aperture_high;
};

// An edge on the analyser.
struct Edge {
    float at;
    bool of_pixel;
};

float blur_at(Piece piece, Edge edge) {
    return edge.of_pixel ? piece.pixel_blur : piece.blur;
}

// Share of the piece between two edges.
float window(Piece piece, Edge low, Edge high) {
    if (!piece.cut) {
        float width = abs(piece.half_width);
        return share_below(high.at, piece.middle, width, blur_at(piece, high))
            - share_below(low.at, piece.middle, width, blur_at(piece, low));
    }
    float scale = 1.0 / (piece.half_cell + piece.shift);
    float low_blur = blur_at(piece, low);
    float high_blur = blur_at(piece, high);
    float low_scale = 1.0 / (abs(piece.half_width) + low_blur);
    float high_scale = 1.0 / (abs(piece.half_width) + high_blur);
    vec3 lines[4] = vec3[4](
        scale * vec3(piece.half_cell, piece.shift, -piece.aperture_low),
        scale * vec3(-piece.half_cell, -piece.shift, piece.aperture_high),
        low_scale * vec3(piece.half_width, -low_blur, piece.middle - low.at),
        high_scale * vec3(-piece.half_width, high_blur, high.at - piece.middle));
    Polygon region = rectangle(1.0, 6.5);
    for (int i = 0; i < 4; i++) cut(region, lines[i]);
    vec2 moments = polygon_moments(region);
    return 0.5 * (moments.x - piece.lean * moments.y);
}

// Share of the piece that passes the detector mask and lands in the pixel [low, high].
float response(Light light, Column column, float row_z, Piece piece, float low, float high) {
    Edge pixel_low = Edge(low, true);
    Edge pixel_high = Edge(high, true);
    Mask mask = light.detector_mask;
    bool masked = mask.present != 0u;
    float sec = secant(column.slope, row_z);
    float leak = masked ? bar_transmission(mask, sec) : 1.0;
    float reach = abs(piece.half_width) + 6.5 * piece.blur;
    float first = max(low, piece.middle - reach) + column.aperture_offset;
    float last = min(high, piece.middle + reach) + column.aperture_offset;
    // Only periods with an aperture in reach: where a driver runs every branch, each counts.
    int from = masked ? int(ceil((first - mask.apertures.at[mask.count - 1u].high) / mask.period)) : 0;
    int to = masked ? int(floor((last - mask.apertures.at[0].low) / mask.period)) : -1;
    int apertures = max(to - from + 1, 0) * int(mask.count);
    float whole = 0.0;
    float open = 0.0;
    // First the whole pixel, behind the bars too; then each aperture. The window stands in the
    // loop once: drivers inline it, and it is long.
    int n = leak >= NEGLIGIBLE ? -1 : 0;
    do {
        Edge lower = pixel_low;
        Edge upper = pixel_high;
        if (n >= 0) {
            int j = from + n / int(mask.count);
            Aperture aperture = mask.apertures.at[n % int(mask.count)];
            float centre = float(j) * mask.period - column.aperture_offset
                + 0.5 * (aperture.low + aperture.high);
            float slope = column.slope + centre / light.analyser;
            float width = effective_width(mask, aperture.high - aperture.low, slope, sec, leak,
                                          piece.detector_shade);
            float a = centre - 0.5 * width;
            float b = centre + 0.5 * width;
            if (b <= low || a >= high || b <= a || n >= apertures) lower = upper;
            else {
                if (b < high) upper = Edge(b, false);
                if (a > low) lower = Edge(a, false);
            }
        }
        float share = window(piece, lower, upper);
        if (n < 0) whole = share;
        else open += max(share, 0.0);
        n++;
    } while (n < apertures);
    if (!masked) return whole;
    return leak < NEGLIGIBLE ? open : leak * whole + (1.0 - leak) * open;
}

void deposit(Light light, Strip strip, Column column, float row_z, uint mask_step, Piece piece,
             RowSpread spread, inout Pending pending) {
    float reach = abs(piece.half_width) + 6.5 * max(piece.blur, piece.pixel_blur);
    float landing = piece.middle + column.pixel_offset - piece.pixel_shift;
    int from = int(floor((landing - reach) / light.pixel + 0.5));
    int to = int(floor((landing + reach) / light.pixel + 0.5));
    // Far outside the detector there is nothing to sum.
    from = max(from, -column.pixel);
    to = min(to, int(light.column_count) - 1 - column.pixel);
    int q = from;
    do {
        float low = (float(q) - 0.5) * light.pixel - column.pixel_offset + piece.pixel_shift;
        float value = piece.amount * response(light, column, row_z, piece, low, low + light.pixel);
        int pixel = column.pixel + q;
        if (q > to || !(value > 0.0)) value = 0.0;
        q++;
        if (spread.near) {
            if (pixel != pending.pixel) {
                flush(light, strip.row, mask_step, pending);
                pending.pixel = pixel;
            }
            pending.rows += value * spread.shares;
        } else {
            float span = spread.half_height + 6.0 * light.row_blur;
            int top = int(floor(spread.middle - span));
            int bottom = int(floor(spread.middle + span));
            float above = 0.0;
            for (int r = top; r <= bottom; r++) {
                float below = share_below(float(r + 1), spread.middle, spread.half_height, light.row_blur);
                add_to_steps(light, strip.row + r, pixel, mask_step, value * (below - above));
                above = below;
            }
        }
    } while (q <= to);
}

// The part [a, b] of a cell on the analyser. x is where the ray from the centre of the source
// that meets the sample in the same place crosses the cell plane: what the sample does depends
// on it alone. `soft`: variance that the shadows of thick bars add, of the sample mask in the
// cell plane and of the detector mask on the analyser.
Piece piece_of(Light light, Strip strip, Cell cell, float a, float b, float transmission, vec2 soft) {
    float span = cell.x_high - cell.x_low;
    float depth_slope = (cell.depth_high - cell.depth_low) / span;
    float bend = (cell.displacement_high - cell.displacement_low) / span;
    float middle = 0.5 * (a + b);
    float width = b - a;
    float from_low = middle - cell.x_low;
    float growth = light.magnification + bend;
    float lean = depth_slope * width;
    Piece piece;
    piece.amount = transmission * exp(-(cell.depth_low + depth_slope * from_low)) * width
        * (1.0 + lean * lean / 24.0) * light.weight * (strip.bottom - strip.top);
    piece.middle = light.magnification * middle + cell.displacement_low + bend * from_low;
    piece.half_width = 0.5 * growth * width;
    float shadow = growth * growth * soft.x;
    piece.blur = sqrt(light.spot * light.spot + shadow + soft.y + cell.spread);
    piece.pixel_blur = sqrt(light.pixel_spot * light.pixel_spot + shadow + cell.spread);
    piece.pixel_shift = cell.pixel_shift;
    piece.lean = 0.5 * lean;
    piece.detector_shade = cell.detector_shade;
    piece.cut = false;
    piece.half_cell = 0.5 * width;
    return piece;
}

// Without a cut the lean only moves the centre of the light.
void settle(inout Piece piece) {
    piece.middle -= piece.half_width * piece.lean / 3.0;
}

// The first cell from `first` on whose upper (or lower) end lies beyond x; cells are sorted.
uint cell_beyond(Strip strip, float x, uint first, bool upper) {
    uint last = strip.count;
    while (first < last) {
        uint middle = (first + last) / 2u;
        Cell cell = push.cells.at[strip.first + middle];
        bool beyond = upper ? cell.x_high > x : cell.x_low >= x;
        if (beyond) last = middle;
        else first = middle + 1u;
    }
    return first;
}

void main() {
    uint index = push.first_strip + gl_GlobalInvocationID.x;
    uint mask_step = push.first_step + gl_GlobalInvocationID.y;
    if (gl_GlobalInvocationID.x >= push.strip_count) return;
    Light light = push.light_ref.at[0];
    Strip strip = push.strips.at[index];
    Column column = light.columns.at[strip.column];
    column.sample_offset += light.mask_move;
    column.aperture_offset -= light.landing_move;
    column.pixel_offset -= light.pixel_move;
    column.slope -= light.slope_move;
    float row_middle = float(strip.row) + 0.5 * (strip.top + strip.bottom);
    float row_z = (row_middle - light.middle_row) * light.row_slope;

    Mask mask = light.sample_mask;
    float sec = secant(column.slope, row_z);
    float leak = mask.present == 0u ? 1.0 : bar_transmission(mask, sec);
    float offset = mask.present == 0u ? 0.0 : light.offsets.at[mask_step] - column.sample_offset;

    float other_leak = bar_transmission(light.detector_mask, sec);
    vec2 soft = vec2(edge_variance(mask, column.slope, sec, leak),
                     edge_variance(light.detector_mask, column.slope, sec, other_leak));

    Pending pending = Pending(column.pixel, vec3(0.0));
    bool masked = mask.present != 0u;
    bool faint = masked && leak > NEGLIGIBLE && leak < FAINT;
    bool every = leak >= FAINT;
    // A source without extent, or cells in the plane of the mask: the cut is sharp.
    bool sharp = light.shift <= 0.0;
    float reach = 6.5 * light.shift;
    Aperture ends = Aperture(push.cells.at[strip.first].x_low,
                             push.cells.at[strip.first + strip.count - 1u].x_high);
    float low_side = masked ? mask.apertures.at[mask.count - 1u].high + reach : 0.0;
    float high_side = masked ? mask.apertures.at[0].low - reach : 0.0;
    int from = masked ? int(ceil((ends.low - offset - low_side) / mask.period)) : 0;
    int to = masked ? int(floor((ends.high - offset - high_side) / mask.period)) : -1;
    int apertures = max(to - from + 1, 0) * int(mask.count);
    // First what the bars leak: of every cell, or so faint that the strip counts as one cell
    // (index `count`); then each aperture with the cells that it lets light through. deposit()
    // stands in the loop once: drivers inline it, and some run the body for nothing.
    int n = -1;
    uint i = faint ? strip.count : 0u;
    uint stop = faint ? strip.count + 1u : (every ? strip.count : 0u);
    float middle_x = 0.0, slope_x = 0.0; // of the aperture
    for (;;) {
        while (n < apertures && i >= stop) {
            n++;
            if (n >= apertures) break;
            int k = from + n / int(mask.count);
            Aperture aperture = mask.apertures.at[n % int(mask.count)];
            float centre = float(k) * mask.period + offset + 0.5 * (aperture.low + aperture.high);
            // Effective apertures are narrower than these.
            float widest = aperture.high - aperture.low;
            i = cell_beyond(strip, centre - 0.5 * widest - reach, 0u, true);
            stop = cell_beyond(strip, centre + 0.5 * widest + reach, i, false);
            middle_x = centre;
            slope_x = column.slope + centre / light.cell_plane;
        }
        if (n >= apertures) break;
        bool all = i == strip.count;
        Cell cell = push.cells.at[strip.first + (all ? 0u : i)];
        i++;
        if (all) {
            // Bars of this leak pass about 1e-6 of open beam: where in the strip does not matter.
            cell.x_high = ends.high;
            cell.depth_low = cell.depth_high = 0.0;
            cell.displacement_low = cell.displacement_high = 0.0;
            cell.pixel_shift = 0.0;
        }
        float from_x = cell.x_low;
        float to_x = cell.x_high;
        bool cut_ = false;
        float low = 0.0, high = 0.0;
        if (n >= 0) {
            Aperture aperture = mask.apertures.at[n % int(mask.count)];
            float width = effective_width(mask, aperture.high - aperture.low, slope_x, sec, leak,
                                          cell.sample_shade);
            low = middle_x - 0.5 * width;
            high = middle_x + 0.5 * width;
            if (high <= low || high + reach <= cell.x_low || low - reach >= cell.x_high) continue;
            bool inside = low + reach <= cell.x_low && high - reach >= cell.x_high;
            if (sharp) {
                from_x = max(cell.x_low, low);
                to_x = min(cell.x_high, high);
            }
            cut_ = !inside && !sharp;
        }
        float share = n < 0 ? (all ? 1.0 : leak) : 1.0 - leak;
        Piece piece = piece_of(light, strip, cell, from_x, to_x, share, all ? vec2(0.0) : soft);
        if (all) piece.amount = leak * strip.light * light.weight * (strip.bottom - strip.top);
        if (cut_) {
            float middle = 0.5 * (from_x + to_x);
            piece.cut = true;
            piece.shift = light.shift;
            piece.aperture_low = low - middle;
            piece.aperture_high = high - middle;
        } else {
            settle(piece);
        }
        deposit(light, strip, column, row_z, mask_step, piece, row_spread(light, strip, cell), pending);
    }
    flush(light, strip.row, mask_step, pending);
}
