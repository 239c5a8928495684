#version 460
// Sizes the dispatches of the next stage of the refinement: one invocation. A level of the refinement may
// take several turns of the stages, and a turn several submissions.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"

// Most items of a dispatch: it has at most 65,535 workgroups.
const uint MOST = 65535u * GROUP;

uint head(uint word) {
    return P.head.at[word];
}

void set(uint word, uint value) {
    P.head.at[word] = value;
}

void dispatch(uint stage, uint first, uint count) {
    uint words = HEAD_STAGES + stage * STAGE_WORDS;
    set(words, first);
    set(words + 1u, count);
    set(words + 2u, (count + GROUP - 1u) / GROUP);
    set(words + 3u, 1u);
    set(words + 4u, 1u);
}

// Takes items from a cursor to an end, at most this many, and as far as the submission has room for
// them; `cost`: of an item.
uint take(uint stage, uint cursor, uint end, uint most, uint cost) {
    uint first = head(cursor);
    uint count = min(min(end - first, most), min(head(HEAD_ROOM) / cost, MOST));
    dispatch(stage, first, count);
    set(cursor, first + count);
    set(HEAD_ROOM, head(HEAD_ROOM) - cost * count);
    return count;
}

// Empties the queues of rays, but for the rays made.
void trace(uint rays) {
    Words queues = P.queues;
    set(HEAD_EXACT, head(HEAD_EXACT) + queues.at[QUEUE_EXACT * QUEUE_HEAD]);
    set(HEAD_LEFT, head(HEAD_LEFT) + queues.at[QUEUE_LEFT * QUEUE_HEAD]);
    set(HEAD_LOST, head(HEAD_LOST) + queues.at[QUEUE_LOST * QUEUE_HEAD]);
    for (uint queue = 0u; queue < P.queue_count; queue++) {
        queues.at[queue * QUEUE_HEAD] = 0u;
        queues.at[queue * QUEUE_HEAD + 1u] = 0u;
        queues.at[queue * QUEUE_HEAD + 2u] = 1u;
        queues.at[queue * QUEUE_HEAD + 3u] = 1u;
    }
    queues.at[QUEUE_MADE * QUEUE_HEAD] = rays;
    queues.at[QUEUE_MADE * QUEUE_HEAD + 1u] = (rays + P.rays_of_group - 1u) / P.rays_of_group;
    queues.at[QUEUE_MADE_EXACT * QUEUE_HEAD] = rays;
    queues.at[QUEUE_MADE_EXACT * QUEUE_HEAD + 1u] = (rays + GROUP - 1u) / GROUP;
}

void estimate_from(uint first) {
    set(HEAD_PHASE, PHASE_ESTIMATE);
    set(HEAD_FRESH, first);
    set(HEAD_OLDER, first);
    set(HEAD_AGAIN, 0u);
    set(HEAD_AGAINS, 0u);
}

// Rays of base rectangles, or of the parts of rectangles.
void plan_rays() {
    if (head(HEAD_PHASE) == PHASE_SELECT && head(HEAD_SELECT) == head(HEAD_LISTED + head(HEAD_LIST))) {
        bool is_last = head(HEAD_SPLITS) == 0u;
        set(HEAD_PHASE, is_last ? PHASE_EMIT : PHASE_SPLIT);
        set(HEAD_LEVELS, head(HEAD_LEVELS) + (is_last ? 0u : 1u));
        set(HEAD_SPLIT, 0u);
        set(HEAD_EMIT, 0u);
        set(HEAD_AGAIN, 0u);
        set(HEAD_AGAINS, 0u);
        set(HEAD_LIST, 1u - head(HEAD_LIST));
        // Where the parts of this level begin.
        set(HEAD_FRESH, head(HEAD_RECTANGLES));
    }
    dispatch(STAGE_BASE, 0u, 0u);
    dispatch(STAGE_SPLIT, 0u, 0u);
    uint rays = 0u;
    if (head(HEAD_PHASE) == PHASE_BASE) {
        rays = take(STAGE_BASE, HEAD_BASE, P.all_base, P.batch, 1u);
        if (head(HEAD_BASE) == P.all_base) {
            set(HEAD_FRESH_END, P.own_base);
            estimate_from(0u);
        }
    } else if (head(HEAD_PHASE) == PHASE_SPLIT) {
        uint count = take(STAGE_SPLIT, HEAD_SPLIT, head(HEAD_SPLITS), P.batch / 2u, 2u);
        uint first = head(HEAD_RECTANGLES);
        if (3u * count > P.room - first) {
            dispatch(STAGE_SPLIT, 0u, 0u);
            set(HEAD_PHASE, PHASE_FULL);
        } else {
            set(HEAD_RECTANGLES, first + 3u * count);
            uint list = HEAD_LISTED + head(HEAD_LIST);
            set(list, head(list) + 3u * count);
            rays = 2u * count;
            set(HEAD_RAYS, head(HEAD_RAYS) + rays);
            if (head(HEAD_SPLIT) == head(HEAD_SPLITS)) {
                set(HEAD_FRESH_END, head(HEAD_RECTANGLES));
                estimate_from(head(HEAD_FRESH));
            }
        }
    }
    dispatch(STAGE_KEEP, 0u, rays);
    trace(rays);
}

void plan_estimate() {
    dispatch(STAGE_ESTIMATE, 0u, 0u);
    if (head(HEAD_PHASE) != PHASE_ESTIMATE) return;
    take(STAGE_ESTIMATE, HEAD_FRESH, head(HEAD_FRESH_END), MOST, 1u);
    if (head(HEAD_FRESH) == head(HEAD_FRESH_END)) set(HEAD_PHASE, PHASE_AGAIN);
}

void plan_again() {
    dispatch(STAGE_AGAIN, 0u, 0u);
    dispatch(STAGE_BUDGET, 0u, 0u);
    if (head(HEAD_PHASE) != PHASE_AGAIN) return;
    take(STAGE_AGAIN, HEAD_AGAIN, head(HEAD_AGAINS), MOST, 1u);
    if (head(HEAD_AGAIN) < head(HEAD_AGAINS)) return;
    set(HEAD_PHASE, PHASE_SELECT);
    set(HEAD_SELECT, 0u);
    set(HEAD_SPLITS, 0u);
    set(HEAD_LISTED + 1u - head(HEAD_LIST), 0u);
    dispatch(STAGE_BUDGET, 0u, P.patch_count);
}

void plan_select() {
    dispatch(STAGE_SELECT, 0u, 0u);
    if (head(HEAD_PHASE) != PHASE_SELECT) return;
    take(STAGE_SELECT, HEAD_SELECT, head(HEAD_LISTED + head(HEAD_LIST)), MOST, 1u);
}

// Rectangles at which runs may begin; one whose run has no room for its cells is looked at again later.
void plan_runs() {
    dispatch(STAGE_RUNS, 0u, 0u);
    set(HEAD_MADE, 0u);
    set(HEAD_RUNS, 0u);
    if (head(HEAD_PHASE) != PHASE_EMIT) return;
    uint cells = head(HEAD_CELLS);
    uint most = (P.cell_room - cells) / most_cells();
    set(HEAD_RESERVED, cells);
    bool retries = head(HEAD_EMIT) == head(HEAD_RECTANGLES);
    set(HEAD_RETRIES, retries ? 1u : 0u);
    if (retries) {
        // Most runs are short.
        take(STAGE_RUNS, HEAD_AGAIN, head(HEAD_AGAINS), cells == 0u ? (most + 63u) / 64u : most / 64u, 1u);
        return;
    }
    uint end = head(HEAD_EMIT) < P.own_base ? P.own_base : head(HEAD_RECTANGLES);
    take(STAGE_RUNS, HEAD_EMIT, end, most, 1u);
    // Base rectangles of neighbours lie behind all others.
    if (head(HEAD_EMIT) == P.own_base) set(HEAD_EMIT, P.all_base);
}

// Cells of the rectangles of these runs, and their rows.
void plan_emit() {
    dispatch(STAGE_EMIT, 0u, head(HEAD_MADE));
    dispatch(STAGE_ROWS, 0u, head(HEAD_RUNS));
}

bool has_emitted() {
    return head(HEAD_PHASE) == PHASE_EMIT && head(HEAD_EMIT) == head(HEAD_RECTANGLES)
        && head(HEAD_AGAIN) == head(HEAD_AGAINS);
}

// Cells of merged light, behind all others.
void plan_merge() {
    dispatch(STAGE_MERGE, 0u, 0u);
    if (!has_emitted()) return;
    uint each = max(S.groups, 1u) * MERGED_COLUMNS;
    take(STAGE_MERGE, HEAD_MERGE, P.patch_count, (P.cell_room - head(HEAD_CELLS)) / each, 1u);
}

// The report, where all cells are made; and lists of the cell rows of a spectrum, one behind the other.
void plan_end() {
    dispatch(STAGE_PLACE, 0u, 0u);
    dispatch(STAGE_REPORT, 0u, 0u);
    bool ends = has_emitted();
    if (has_spectrum()) {
        uint kinds = 2u * (S.groups + S.nodes);
        uint first = 0u;
        for (uint kind = 0u; kind < kinds; kind++) {
            S.counts.at[kinds + 1u + kind] = first;
            first += S.counts.at[kind];
        }
        dispatch(STAGE_PLACE, 0u, S.counts.at[kinds]);
        ends = ends && head(HEAD_MERGE) == P.patch_count;
    }
    if (!ends) return;
    set(HEAD_PHASE, PHASE_DONE);
    dispatch(STAGE_REPORT, 0u, P.patch_count);
}

void main() {
    if (gl_GlobalInvocationID.x != 0u) return;
    switch (push.stage) {
    case STAGE_BASE: plan_rays(); break;
    case STAGE_ESTIMATE: plan_estimate(); break;
    case STAGE_AGAIN: plan_again(); break;
    case STAGE_SELECT: plan_select(); break;
    case STAGE_RUNS: plan_runs(); break;
    case STAGE_EMIT: plan_emit(); break;
    case STAGE_MERGE: plan_merge(); break;
    default: plan_end(); break;
    }
}
