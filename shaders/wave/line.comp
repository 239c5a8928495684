// Light of a line of rays in the pixels of its beamlet, at all mask steps: products of pairs of rays at each
// shear, summed along x, make the transform of the intensity at the frequency of the shear (docs/waves.md). A
// workgroup has a line and some steps and pixels.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/WaveLinePush.glsl"

#include "wave/turn.glsl"

// Sum of the products of an invocation, then of those before it.
shared vec2 totals[GROUP];

struct Shear {
    uint index;
    // Pairs of the line, and of an invocation.
    uint count;
    uint each;
    // Place of the first pair's sum.
    uint first_sum;
};

// Frequency per cell.
float cycles_per_cell(WaveParams params, Shear shear) {
    return float(shear.index * params.turn) * 2.3283064365386963e-10;
}

// Product of the rays of a pair, turned by the frequency from the first ray of the line.
vec2 product(WaveParams params, WaveLine line, Shear shear, uint i) {
    uint whole = i * shear.index * params.turn;
    float cycles = float(int(whole)) * 2.3283064365386963e-10;
    vec2 field = vec2(1.0, 0.0);
    if (line.first_ray != WAVE_EMPTY) {
        uint low_ray = line.first_ray + i;
        uint high_ray = low_ray + shear.index * params.pairs;
        WaveField low = push.fields.at[low_ray];
        WaveField high = push.fields.at[high_ray];
        field = times_conjugate(vec2(low.re, low.im), vec2(high.re, high.im));
        float moved = 0.5 * (low.displacement + high.displacement);
        float more = float(shear.index) * params.frequency * moved;
        cycles += more - floor(more + 0.5);
        float variance = 0.0;
        for (uint law = 0u; law < push.laws; law++) {
            float of_pair = push.variances.at[low_ray * push.laws + law]
                + push.variances.at[high_ray * push.laws + law];
            variance += 0.5 * of_pair * Floats(params.laws).at[shear.index * push.laws + law];
        }
        if (variance > 0.0) {
            float turns = 6.283185307179586 * float(shear.index) * params.frequency;
            field *= exp(-0.5 * turns * turns * variance);
        }
    }
    return times(field, turned(-cycles));
}

// Sums of the products up to each pair.
void sum_products(WaveParams params, WaveLine line, Shear shear) {
    uint own = gl_LocalInvocationID.x;
    uint from = min(own * shear.each, shear.count);
    uint to = min(from + shear.each, shear.count);
    vec2 sum = vec2(0.0);
    for (uint i = from; i < to; i++) {
        sum += product(params, line, shear, i);
        push.sums.at[shear.first_sum + i] = WavePair(sum.x, sum.y);
    }
    totals[own] = sum;
    memoryBarrierBuffer();
    barrier();
    if (own == 0u) {
        vec2 before = vec2(0.0);
        for (uint i = 0u; i < GROUP; i++) {
            vec2 total = totals[i];
            totals[i] = before;
            before += total;
        }
    }
    barrier();
}

// Sum of the first pairs.
vec2 sum_of(Shear shear, uint pairs) {
    if (pairs == 0u) return vec2(0.0);
    WavePair sum = push.sums.at[shear.first_sum + pairs - 1u];
    return totals[(pairs - 1u) / shear.each] + vec2(sum.re, sum.im);
}

// Integral up to a place, and product there.
struct End {
    vec2 sum;
    vec2 value;
};

// End of an integral, in cells from the low end of the first pair. `cycles`: frequency per cell; the part of a cell
// has the phase of its own middle.
End end_at(Shear shear, float cycles, float place) {
    float at = clamp(place, 0.0, float(shear.count));
    uint whole = min(uint(at), shear.count - 1u);
    vec2 below = sum_of(shear, whole);
    float part = at - float(whole);
    vec2 own = sum_of(shear, whole + 1u) - below;
    return End(below + part * times(own, turned(0.5 * (1.0 - part) * cycles)),
               times(own, turned((0.5 - part) * cycles)));
}

// Integral over middles of pairs from `low` to `high`, in cells from the centre of the line. The sample moves against
// the mask as the focal spot sees it: to first order by the derivative of its product, without the phase of the
// frequency, which the blur of the spot has.
vec2 between(WaveParams params, Shear shear, float low, float high) {
    if (!(high > low) || shear.count == 0u) return vec2(0.0);
    float begin = 0.5 * float(shear.count);
    float cycles = cycles_per_cell(params, shear);
    End from = end_at(shear, cycles, low + begin);
    End to = end_at(shear, cycles, high + begin);
    vec2 sum = to.sum - from.sum;
    WavePair motion = WavePairs(params.motions).at[shear.index];
    vec2 change = to.value - from.value + 6.283185307179586 * cycles * vec2(-sum.y, sum.x);
    return sum + times(vec2(motion.re, motion.im), change);
}

// Transform of the light behind the mask: amplitude 1 in apertures, of the bars beside them.
vec2 transform(WaveParams params, Shear shear, float low, float high) {
    // No mask.
    if (params.bars == 1.0) return between(params, shear, -0.5 * params.period, 0.5 * params.period);
    float half_shear = 0.5 * float(shear.index) * params.mask_shear;
    vec2 open = vec2(0.0);
    for (uint k = 0u; k <= params.neighbours; k++) {
        float shift = float(k) * params.period;
        // The ray on the low side is in this aperture, the other one in itself or one on the high side.
        float from = max(low + half_shear, low + shift - half_shear);
        float to = min(high + half_shear, high + shift - half_shear);
        open += between(params, shear, from, to);
    }
    if (params.bars == 0.0) return open;
    float rest = 1.0 - params.bars;
    vec2 either = between(params, shear, low + half_shear, high + half_shear)
        + between(params, shear, low - half_shear, high - half_shear);
    vec2 all = between(params, shear, -0.5 * params.period, 0.5 * params.period);
    return rest * rest * open + params.bars * (rest * either + params.bars * all);
}

void main() {
    WaveParams params = push.params.at[0];
    uint line_index = push.first_line + gl_WorkGroupID.x;
    WaveLine line = push.lines.at[line_index];
    WaveBeamlet beamlet = WaveBeamlets(params.beamlets).at[line.beamlet];
    uint item = gl_WorkGroupID.y * GROUP + gl_LocalInvocationID.x;
    uint step_ = item / params.target_stride;
    uint target = item % params.target_stride;
    bool has = step_ < push.steps && target < beamlet.target_count;
    float offset = 0.0;
    uint response = 0u;
    if (has) {
        offset = push.offsets.at[step_] * params.cells;
        response = Words(params.targets).at[beamlet.first_target + target] * params.shears;
    }
    float light = 0.0;
    uint dispatched = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    for (uint j = 0u; j < params.shears; j++) {
        uint count = params.rays - min(j * params.pairs, params.rays);
        Shear shear = Shear(j, count, (count + GROUP - 1u) / GROUP, dispatched * params.rays);
        sum_products(params, line, shear);
        if (has) {
            float tilt = beamlet.tilt * offset;
            vec2 found = transform(params, shear, beamlet.low + offset + tilt,
                                   beamlet.high + offset - tilt);
            WavePair effect = WavePairs(params.responses).at[response + j];
            float turns = 6.283185307179586 * cycles_per_cell(params, shear);
            float soft = exp(-0.5 * turns * turns * beamlet.variance);
            light += soft * (found.x * effect.re - found.y * effect.im);
        }
        // The next sums replace these.
        barrier();
    }
    uint at = (line_index * push.steps + step_) * params.target_stride + target;
    if (step_ < push.steps && target < params.target_stride) {
        push.light.at[at] = (push.adds != 0u ? push.light.at[at] : 0.0) + light;
    }
}
