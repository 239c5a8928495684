// Four normal equations: their sums, their Cholesky factor, their condition number.

// Upper triangle of a symmetric matrix by rows, and the right side.
struct Normal {
    vec4 row0;
    vec3 row1;
    vec2 row2;
    float row3;
    vec4 right;
};

Normal no_equations() {
    // A background that is no unknown has an equation of its own: no step.
    float last = push.background_is_free != 0u ? 0.0 : 1.0;
    return Normal(vec4(0.0), vec3(0.0), vec2(0.0), last, vec4(0.0));
}

void accumulate(inout Normal n, vec4 slope, float weight, float residual) {
    vec4 weighted = weight * slope;
    n.row0 += weighted.x * slope;
    n.row1 += weighted.y * slope.yzw;
    n.row2 += weighted.z * slope.zw;
    n.row3 += weighted.w * slope.w;
    n.right += weighted * residual;
}

vec4 diagonal(Normal n) {
    return vec4(n.row0.x, n.row1.x, n.row2.x, n.row3);
}

// Lower triangle: the diagonal's reciprocals, and the rest by columns.
struct Factor {
    vec4 inverse;
    vec3 column0;
    vec2 column1;
    float column2;
};

// Scaled to a unit diagonal (`scale` = 1 / sqrt of it), plus damping; false where not positive.
bool factorise(Normal n, vec4 scale, float damping, out Factor f) {
    vec4 d = diagonal(n) * scale * scale + damping;
    vec3 c0 = n.row0.yzw * scale.x * scale.yzw;
    vec2 c1 = n.row1.yz * scale.y * scale.zw;
    float c2 = n.row2.y * scale.z * scale.w;
    const float least = 1e-6;
    f.inverse.x = inversesqrt(max(d.x, least));
    f.column0 = c0 * f.inverse.x;
    float y = d.y - f.column0.x * f.column0.x;
    f.inverse.y = inversesqrt(max(y, least));
    f.column1 = (c1 - f.column0.x * f.column0.yz) * f.inverse.y;
    float z = d.z - f.column0.y * f.column0.y - f.column1.x * f.column1.x;
    f.inverse.z = inversesqrt(max(z, least));
    f.column2 = (c2 - f.column0.y * f.column0.z - f.column1.x * f.column1.y) * f.inverse.z;
    float w = d.w - f.column0.z * f.column0.z - f.column1.y * f.column1.y - f.column2 * f.column2;
    f.inverse.w = inversesqrt(max(w, least));
    return min(min(d.x, y), min(z, w)) > least;
}

// Solves for a right side in the scaled unknowns.
vec4 substitute(Factor f, vec4 b) {
    b.x *= f.inverse.x;
    b.yzw -= f.column0 * b.x;
    b.y *= f.inverse.y;
    b.zw -= f.column1 * b.y;
    b.z *= f.inverse.z;
    b.w = (b.w - f.column2 * b.z) * f.inverse.w;
    b.w *= f.inverse.w;
    b.z = (b.z - f.column2 * b.w) * f.inverse.z;
    b.y = (b.y - dot(f.column1, b.zw)) * f.inverse.y;
    b.x = (b.x - dot(f.column0, b.yzw)) * f.inverse.x;
    return b;
}

vec4 times(Normal n, vec4 scale, vec4 v) {
    vec4 u = v * scale;
    return scale * vec4(dot(n.row0, u), n.row0.y * u.x + dot(n.row1, u.yzw),
        n.row0.z * u.x + n.row1.y * u.y + dot(n.row2, u.zw),
        n.row0.w * u.x + n.row1.z * u.y + n.row2.y * u.z + n.row3 * u.w);
}

// Largest over smallest eigenvalue of the matrix scaled to a unit diagonal, by the power method: never
// too large, and within a few per cent near 100, where the smallest eigenvalue is separate.
float condition(Normal n, vec4 scale, Factor f) {
    vec4 up = vec4(1.0, 0.3, 0.6, 0.8);
    vec4 down = vec4(1.0, 0.2, -0.7, -0.9);
    for (int i = 0; i < 10; i++) {
        up = normalize(times(n, scale, up));
        down = normalize(substitute(f, down));
    }
    return dot(up, times(n, scale, up)) * dot(down, substitute(f, down));
}
