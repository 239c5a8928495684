// Lists of all crossings, sorted afterwards.

void list_add(inout Gathered list, Crossing crossing) {
    if (list.count < push.capacity) list_set(list, list.count, crossing);
    list.count += 1u;
}

// Shell's sort: lists are short, but for a few of hundreds.
void list_sort(Gathered list) {
    uint gap = 1u;
    while (gap < list.count / 3u) gap = 3u * gap + 1u;
    for (; gap > 0u; gap /= 3u) {
        for (uint i = gap; i < list.count; i++) {
            Crossing crossing = list_at(list, i);
            uint j = i;
            while (j >= gap) {
                Crossing before = list_at(list, j - gap);
                if (!later(before, crossing)) break;
                list_set(list, j, before);
                j -= gap;
            }
            if (j != i) list_set(list, j, crossing);
        }
    }
}
