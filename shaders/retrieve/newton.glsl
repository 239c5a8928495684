// Newton's steps with residuals in twofold arithmetic. For counts, weights follow the fit (Fisher
// scoring): the fixed point is the maximum of the Poisson likelihood.

struct NewtonFit {
    Normal normal; // weighted, without second derivatives: the information of the fit
    float squares; // sum of squared residuals
};

float residual_of(Curve c, Gaussian g, uint i, float y, out float t, out float e) {
    Step at = push.steps.at[i];
    Twofold x = add(Twofold(at.offset, at.offset_low), Twofold(-g.centre, 0.0));
    Twofold u = divide(x, g.width);
    Twofold h = multiply(u, u);
    Twofold bell = exp_minus(Twofold(0.5 * h.high, 0.5 * h.low));
    t = u.high;
    e = bell.high;
    Twofold f = multiply(bell, Twofold(g.amplitude, 0.0));
    f = add(f, Twofold(g.background, 0.0));
    Twofold d = two_sum(y, -c.least);
    d = add(Twofold(d.high * c.scale, d.low * c.scale), Twofold(-f.high, -f.low));
    return d.high;
}

bool newton(Curve c, inout Gaussian g, out NewtonFit last) {
    for (int k = 0; k < 60; k++) {
        last.normal = no_equations();
        last.squares = 0.0;
        Normal second = no_equations();
        for (uint i = 0; i < push.step_count; i++) {
            float y = value(c, i);
            if (y >= c.saturation) continue;
            float t, e;
            float r = residual_of(c, g, i, y, t, e);
            float w = weight(c, g, g.amplitude * e + g.background);
            accumulate(last.normal, slopes(g, t, e), w, r);
            last.squares += r * r;
            // Residual times second derivatives.
            float re = r * e;
            float rae = re * g.amplitude;
            second.row0.yz += re * vec2(t, t * t);
            second.row1.xy += rae * vec2(t * t - 1.0, t * (t * t - 2.0));
            second.row2.x += rae * t * t * (t * t - 2.0);
            // Of the background.
            float by_height = r * push.background_per_area * g.width;
            second.row0.z += by_height;
            second.row2.x += by_height * g.amplitude;
        }
        vec4 scale = inversesqrt(max(diagonal(last.normal), vec4(1e-12)));
        Factor f;
        bool newton = false;
        if (push.poisson == 0u) {
            Normal full = last.normal;
            full.row0 -= second.row0;
            full.row1 -= second.row1;
            full.row2 -= second.row2;
            newton = factorise(full, scale, 0.0, f);
        }
        if (!newton) factorise(last.normal, scale, k < 20 ? 0.0 : 0.3, f);
        vec4 step = scale * substitute(f, scale * last.normal.right);
        g = moved(c, g, step);
        float length = size(g, step);
        // Newton's next step would be the square of this one; scoring gains a factor each time.
        if (length < (newton ? 1e-4 : 1e-6)) return true;
    }
    return false;
}
