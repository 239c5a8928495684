// How a change of a ray's result changes the recorded light.

// Integral of the light through the window at 0 over the landing point.
float integral_of(WindowTable table, float at) {
    Floats values = Floats(table.values);
    if (table.is_sharp != 0u) {
        float sum = 0.0;
        for (uint i = 0u; i < table.count; i += 2u) sum += clamp(at, values.at[i], values.at[i + 1u]);
        return sum;
    }
    float last = float(table.count - 1u);
    float place = clamp((at / table.period + float(WINDOW_REACH)) * float(WINDOW_POINTS), 0.0, last);
    uint index = min(uint(place), table.count - 2u);
    float a = values.at[index];
    return a + (values.at[index + 1u] - a) * (place - float(index));
}

// Share of light spread evenly over [at - half, at + half] that passes the window at 0.
float passed_of(WindowTable table, float at, float half_) {
    return (integral_of(table, at + half_) - integral_of(table, at - half_)) / (2.0 * half_);
}

// Light and where it lands, from the nearest window of the first kind.
struct Landed {
    float light;
    float at;
};

// Light as the windows of a kind see it: the number of the nearest one, and what passes that and those beside it.
struct Seen {
    float home;
    vec3 passed;
};

vec3 passed_near(WindowTable table, Landed landed, float home, float half_) {
    vec3 passed;
    for (int k = -1; k <= 1; k++) {
        passed[k + 1] = landed.light * passed_of(table, landed.at - (home + float(k)) * table.period, half_);
    }
    return passed;
}

// The table has no points within less; and the quotient keeps its digits.
float wide(WindowTable table, float half_) {
    return max(half_, 2.0 * table.period / float(WINDOW_POINTS));
}

Seen seen_by(WindowTable table, Landed own, float half_) {
    float home = round(own.at / table.period);
    return Seen(home, passed_near(table, own, home, wide(table, half_)));
}

float largest(vec3 a, vec3 b) {
    vec3 apart = abs(a - b);
    return max(max(apart.x, apart.y), apart.z);
}

// Largest change of the light in any window of a kind.
float change_in(WindowTable table, Seen seen, Landed own, Landed other, float half_) {
    half_ = wide(table, half_);
    float near = largest(seen.passed, passed_near(table, other, seen.home, half_));
    float home = round(other.at / table.period);
    if (home == seen.home) return near;
    vec3 there = passed_near(table, own, home, half_);
    return max(near, largest(there, passed_near(table, other, home, half_)));
}
