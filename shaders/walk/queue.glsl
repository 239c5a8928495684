// Rays for later passes, and further attempts to trace a ray. Push constants of the kernel: `queues`.

// Puts the index of a ray into a queue, and adds an invocation for it to the pass over the queue.
void enqueue(uint queue, Words indices, uint index) {
    uint head = queue * QUEUE_HEAD;
    uint slot = atomicAdd(push.queues.at[head], 1u);
    if (slot % GROUP == 0u) atomicAdd(push.queues.at[head + 1u], 1u);
    indices.at[slot] = index;
}

// Number of rays in a queue.
uint queued(uint queue) {
    return push.queues.at[queue * QUEUE_HEAD];
}

// A ray as an attempt traces it, m to the side: far below any accuracy wanted, far above the rounding of
// coordinates that made an edge ambiguous.
Ray attempted(Ray ray, uint attempt) {
    float to_side = attempt == 0u ? 0.0
        : attempt == 1u ? 3e-10
        : attempt == 2u ? -7e-10
        : attempt == 3u ? 2.3e-9 : -6e-9;
    ray.x += to_side;
    ray.z += 0.7 * to_side;
    return ray;
}
