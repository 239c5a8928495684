// Refraction without cancellation (docs/physics.md, "Refraction").

const float LEAST_ALONG = 1e-9; // cosine of incidence, about: rays along a surface stay finite

// Change of slope (x, z) per unit change of delta at a surface, first order.
// `normal` in the beam frame, either sign.
vec2 slope_per_delta(vec2 slope, vec3 normal) {
    float along = normal.x * slope.x + normal.y + normal.z * slope.y;
    if (abs(along) < LEAST_ALONG) along = along < 0.0 ? -LEAST_ALONG : LEAST_ALONG;
    float norm2 = 1.0 + dot(slope, slope);
    return -norm2 * (vec2(normal.x, normal.z) - normal.y * slope) / along;
}

// Cosine of incidence, >= 0. `inverse_stretch`: 1 / sqrt(1 + slope^2).
float incidence(vec2 slope, vec3 normal, float inverse_stretch) {
    float along = normal.x * slope.x + normal.y + normal.z * slope.y;
    return abs(along) * inverse_stretch;
}

// Exact change of slope from medium delta_i to delta_r; `reflected` on total reflection.
vec2 refract_slope(vec2 slope, vec3 normal, float delta_i, float delta_r, out bool reflected) {
    vec3 i = normalize(vec3(slope.x, 1.0, slope.y));
    float c = dot(normal, i);
    if (c < 0.0) {
        normal = -normal;
        c = -c;
    }
    vec3 tangent = i - c * normal;
    float s2 = dot(tangent, tangent);
    float eps = (delta_r - delta_i) / (1.0 - delta_r);
    float bend = eps * (2.0 + eps) * s2;
    float q = c * c - bend;
    reflected = q < 0.0;
    vec3 change = reflected ? -2.0 * c * normal : eps * tangent - (bend / (c + sqrt(q))) * normal;
    return (vec2(change.x, change.z) - change.y * slope) / (i.y + change.y);
}
