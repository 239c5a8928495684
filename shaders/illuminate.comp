// Light of cells: one invocation per part of a cell row and some mask steps integrates every cell over the
// sample mask, the focal spot, the detector mask and the pixels (docs/developers/numerics.md, "Cells").
// With FAR light may land in rows other than its own and the two beside it; with HEIGHTS apertures end along z,
// too: a strip of the sample mask at a time.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/IlluminatePush.glsl"

#include "physics/gauss.glsl"
#include "physics/absorption.glsl"
#include "random/hash.glsl"
#include "light/sum.glsl"
#include "light/mask.glsl"
#include "light/window.glsl"
#include "light/response.glsl"
#include "light/setting.glsl"
#ifdef HEIGHTS
#include "light/heights.glsl"
#elif defined(FAR)
#include "light/far_rows.glsl"
#else
#include "light/near_rows.glsl"
#endif
#ifndef HEIGHTS
// Shares of rows are not kept.
bool shares_left() {
    return false;
}
#endif

// The part of a cell behind an opening, and its landing place: pixels from the beamlet's own.
struct Passed {
    Piece piece;
    int first;
    int last;
    int home; // of faint light behind the detector mask
};

// Shifts of the edges of an opening against a piece of a cell, per standard deviation of the landing place at the edges
// that cut its light behind the sample mask. Soft edges of the detector mask count as the source does.
vec2 shifts_in(Opening opening, Cell cell, Piece piece, Edges edges) {
    float growth = steady_growth((cell.displacement_high - cell.displacement_low) / (cell.x_high - cell.x_low));
    bool masked = light.detector_mask.present != 0u;
    float by_spot = masked ? light.spot * light.spot + setting.soft.y : light.pixel_spot * light.pixel_spot;
    float source = sqrt(by_spot);
    float blur = masked ? piece.blur : piece.pixel_blur;
    vec2 more = vec2(0.0);
#ifdef WALLS
    more = opening.layer.variance - common_variance(opening.layer);
#endif
    vec2 by_source = light.mask_blur + vec2(edges.low_turn, -edges.high_turn);
    return shifts_of(by_source, source / growth, blur / growth, more);
}

// The part of a cell that an opening lets through; no amount where it lets none through.
Piece piece_through(Opening opening, Cell cell) {
    float from_x = cell.x_low;
    float to_x = cell.x_high;
    Edges edges = Edges(from_x, to_x, 0.0, 0.0, 0.0, 0.0);
    bool cut = false;
    if (opening.cuts) {
        edges = edges_in(opening, cell.sample_narrowing);
        cut = !setting.sharp
            && (edges.low + setting.reach > from_x || edges.high - setting.reach < to_x);
        if (setting.sharp) {
            from_x = max(from_x, edges.low);
            to_x = min(to_x, edges.high);
        }
    }
    bool passes = edges.high > edges.low && edges.high + setting.reach > cell.x_low
        && edges.low - setting.reach < cell.x_high && to_x > from_x;
    float share = passes ? opening.layer.share : 0.0;
#ifdef WALLS
    vec2 soft = vec2(common_variance(opening.layer), setting.soft.y);
#else
    vec2 soft = vec2(opening.layer.variance, setting.soft.y);
#endif
    Piece piece = piece_of(cell_row, cell, from_x, to_x, share, opening.tilt, soft);
    if (cut) {
#ifdef WALLS
        vec2 shadow = light.sample_mask.thickness
            * abs(wall_slopes(light.sample_mask, beamlet.slope, edges.low, edges.high, light.cell_plane));
#else
        float shadow = light.sample_mask.thickness * bars.slope;
#endif
        cut_by(piece, from_x, to_x, edges, shifts_in(opening, cell, piece, edges));
        piece.sample_covariance = shadow * cell.sample_covariance / (to_x - from_x);
    }
    piece.passes = share > 0.0;
    return piece;
}

// Pixels that the light of a piece reaches.
Passed passed_of(Exposed step_, Piece piece) {
    Mask behind = light.detector_mask;
    float span = abs(piece.half_width) + 6.5 * max(piece.blur, piece.pixel_blur);
    float landing = piece.middle + beamlet.pixel_offset - piece.pixel_shift;
    float first_landing = landing - span;
    float last_landing = landing + span;
    vec2 passing = between_edges(piece);
    float middle_landing = landing + 0.5 * (passing.x + passing.y) * piece.half_width;
    int home = int(floor(middle_landing / light.pixel_pitch + 0.5));
    if (behind.present != 0u && bars_behind.leak < FAINT) {
        // Only pixels with an aperture in reach, and the pixel of faint light.
        ivec2 reached = periods_in_reach(behind, bars_behind, beamlet, piece);
        float to_edges = beamlet.pixel_offset - piece.pixel_shift - beamlet.aperture_offset;
        first_landing = max(first_landing,
                            float(reached.x) * behind.period - bars_behind.reach + to_edges);
        last_landing = min(last_landing,
                           float(reached.y) * behind.period + bars_behind.reach + to_edges);
    }
    int first = int(floor(first_landing / light.pixel_pitch + 0.5));
    int last = int(floor(last_landing / light.pixel_pitch + 0.5));
    if (bars_behind.leak >= NEGLIGIBLE) {
        first = min(first, home);
        last = max(last, home);
    }
    first = max(first, step_.pixels.x);
    return Passed(piece, first, piece.passes ? min(last, step_.pixels.y) : first - 1, home);
}

// Light of all cells that an opening lets through.
void light_through(Exposed step_, Opening opening, inout Landing landing) {
    // A cell and a pixel at a time, and with HEIGHTS some rows: where a driver runs every branch, invocations would wait for
    // the one whose cell reaches most pixels.
    Cell cell;
    Passed passed;
    passed.first = 0;
    passed.last = -1;
    passed.home = 0;
    uint i = max(opening.first, part.first);
#ifdef HEIGHTS
    int first_pixel = 0;
#endif
    do {
        bool is_done = passed.first > passed.last;
#ifdef HEIGHTS
        if (is_done && shares_left()) {
            if (keep_shares(cell)) passed.first = first_pixel;
            is_done = false;
        }
#endif
        if (is_done && i < part.last) {
            cell = push.cells.at[cell_row.first_cell + i];
            // Cells of several energies may share an interval.
            uint next = min(i + 1u, part.last - 1u);
            bool is_last = next == i || push.cells.at[cell_row.first_cell + next].x_low >= opening.beyond;
            i = is_last ? part.last : next;
            passed = passed_of(step_, piece_through(opening, cell));
#ifdef HEIGHTS
            if (passed.first <= passed.last) {
                shares_begin(cell);
                // No pixel before its shares are kept.
                first_pixel = passed.first;
                passed.first = passed.last + 1;
            }
#endif
        }
        if (passed.first <= passed.last) {
            int pixel = passed.first;
            float edge = (float(pixel) - 0.5) * light.pixel_pitch - beamlet.pixel_offset
                + passed.piece.pixel_shift;
#ifdef HEIGHTS
            land_in_rows(landing, passed.piece, pixel, edge, pixel == passed.home);
#else
            float value = passed.piece.amount
                * response(beamlet, bars_behind, passed.piece, edge, edge + light.pixel_pitch,
                           pixel == passed.home);
            if (!(abs(value) < 1e30)) value = 0.0;
            land(landing, cell, pixel, value);
#endif
            passed.first++;
        }
    } while (i < part.last || passed.first <= passed.last || shares_left());
}

// Light of a part of a cell row at a mask step, or the light common to all steps.
void illuminate(uint mask_step) {
    Exposed step_ = exposed_at(mask_step);
    float faint = part.first == 0u ? setting.faint : 0.0;
    Landing landing = landing_begin(mask_step, faint, step_.pixels);
    Place place = step_.from;
    uint layer = 0u;
    uint layers = 1u;
    int n = step_.at_all_steps ? -1 : 0;
    do {
        Opening opening = leak_of();
        if (n >= 0) opening.first = cell_row.cell_count;
        bool is_last = true;
        if (n >= 0 && n < step_.apertures) {
            if (layer == 0u) layers = layers_at(centre_of(step_, place.period));
            opening = opening_of(step_, place, layer, layers);
            layer++;
            is_last = layer == layers;
            if (is_last) {
                place = next_place(light.sample_mask, place);
                layer = 0u;
            }
        }
        light_through(step_, opening, landing);
        if (is_last) n++;
    } while (n < step_.apertures);
    landing_end(landing);
}

void main() {
    uint first_step = push.first_step + gl_GlobalInvocationID.y * push.steps_each;
    uint last_step = min(first_step + push.steps_each, push.last_step);
    if (gl_GlobalInvocationID.x >= push.part_count || first_step >= last_step) return;
    light = push.light_ref.at[0];
    part = push.parts.at[push.first_part + gl_GlobalInvocationID.x];
    cell_row = push.cell_rows.at[part.cell_row];
    part.last = min(part.last, cell_row.cell_count);
    if (part.first >= part.last) return;
    setting_begin();
#ifdef HEIGHTS
    heights_begin();
#endif
    // What bars leak is summed once for all mask steps, behind the last.
    uint last_turn = last_step + (setting.leaks && first_step == 0u ? 1u : 0u);
    uint turn = first_step;
    do {
#ifdef HEIGHTS
        uint mask_step = turn < last_step ? turn : push.steps;
        uint strip = 0u;
        do {
            take_sample_strip(strip, mask_step);
            if (strip_meets() || setting.faint > 0.0) illuminate(mask_step);
            strip++;
        } while (strip < sample_strips(mask_step));
#else
        illuminate(turn < last_step ? turn : push.steps);
#endif
        turn++;
    } while (turn < last_turn);
}
