// Levenberg-Marquardt in f32: from the moments to where Newton's method takes over.

float equations(Curve c, Gaussian g, out Normal n) {
    n = no_equations();
    float cost = 0.0;
    float inverse = 1.0 / g.width;
    for (uint i = 0; i < push.step_count; i++) {
        float y = value(c, i);
        if (y >= c.saturation) continue;
        float t = (push.steps.at[i].offset - g.centre) * inverse;
        float e = exp(-0.5 * t * t);
        float residual = (y - c.least) * c.scale - (g.amplitude * e + g.background);
        accumulate(n, slopes(g, t, e), 1.0, residual);
        cost += residual * residual;
    }
    return cost;
}

void levenberg_marquardt(Curve c, inout Gaussian g) {
    Normal n;
    float cost = equations(c, g, n);
    float damping = 1e-3;
    for (int i = 0; i < 60; i++) {
        vec4 scale = inversesqrt(max(diagonal(n), vec4(1e-12)));
        Factor f;
        factorise(n, scale, damping, f);
        vec4 step = scale * substitute(f, scale * n.right);
        Gaussian next = moved(c, g, step);
        float length = size(g, step);
        Normal m;
        float next_cost = equations(c, next, m);
        if (next_cost <= cost) {
            g = next;
            n = m;
            cost = next_cost;
            damping = max(damping * 0.1, 1e-6);
            if (length < 1e-2) break;
        } else {
            damping *= 8.0;
            if (length < 1e-3 || damping > 1e6) break;
        }
    }
}
