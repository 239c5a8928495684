// Integral of a convex polygon in (xi, t), uniform in xi and normal in t, by Green's theorem.

const int MOST_CORNERS = 9; // a rectangle cut by four lines, and one to spare

struct Polygon {
    vec2 corner[MOST_CORNERS];
    int count;
};

Polygon rectangle(float half_width, float half_height) {
    Polygon p;
    p.corner[0] = vec2(-half_width, -half_height);
    p.corner[1] = vec2(half_width, -half_height);
    p.corner[2] = vec2(half_width, half_height);
    p.corner[3] = vec2(-half_width, half_height);
    p.count = 4;
    return p;
}

// Keeps what lies where line.x * xi + line.y * t + line.z >= 0.
void cut(inout Polygon p, vec3 line) {
    Polygon kept;
    kept.count = 0;
    for (int i = 0; i < p.count; i++) {
        vec2 here = p.corner[i];
        vec2 there = p.corner[i + 1 == p.count ? 0 : i + 1];
        float a = dot(line.xy, here) + line.z;
        float b = dot(line.xy, there) + line.z;
        if (a >= 0.0 && kept.count < MOST_CORNERS) {
            kept.corner[kept.count] = here;
            kept.count += 1;
        }
        if ((a >= 0.0) != (b >= 0.0) && kept.count < MOST_CORNERS) {
            kept.corner[kept.count] = mix(here, there, a / (a - b));
            kept.count += 1;
        }
    }
    p = kept;
}

// (integral of phi(t), integral of xi phi(t)) over the polygon.
vec2 polygon_moments(Polygon p) {
    vec2 sum = vec2(0.0);
    if (p.count < 3) return sum;
    float density_a, below_a;
    normal(p.corner[0].y, density_a, below_a);
    for (int i = 0; i < p.count; i++) {
        vec2 a = p.corner[i];
        vec2 b = p.corner[i + 1 == p.count ? 0 : i + 1];
        float density_b, below_b;
        normal(b.y, density_b, below_b);
        float dt = b.y - a.y;
        // Along the edge xi = alpha + beta t; closed integrals of xi phi and xi^2 phi.
        if (abs(dt) < 0.05) {
            vec2 m = 0.5 * (a + b);
            float density_m = INV_SQRT_2PI * exp(-0.5 * m.y * m.y);
            sum += dt / 6.0
                * vec2(a.x * density_a + 4.0 * m.x * density_m + b.x * density_b,
                       0.5 * (a.x * a.x * density_a + 4.0 * m.x * m.x * density_m
                              + b.x * b.x * density_b));
        } else {
            float beta = (b.x - a.x) / dt;
            float alpha = a.x - beta * a.y;
            float phi = below_b - below_a;
            float step_ = density_b - density_a;
            float second = phi - (b.y * density_b - a.y * density_a);
            sum += vec2(alpha * phi - beta * step_,
                        0.5 * (alpha * alpha * phi - 2.0 * alpha * beta * step_
                               + beta * beta * second));
        }
        density_a = density_b;
        below_a = below_b;
    }
    return sum;
}
