// Rough surfaces: normals that rays draw (docs/physics.md, "Roughness").

const uint NORMALS = 64u; // drawn, until one faces the ray
const uint PASSES = 16u;  // of a ray through one place of a rough surface
const float LEAVES = 2e-6; // least sine of the angle under which it leaves: rounding loses closer ones

// The normal that a ray along `direction` draws at a surface, on the side that the ray goes to.
// `normal_`: of the facet, either sign; `draw`: the first of those that it draws there.
vec3 drawn_normal(vec3 normal_, vec3 direction, Surface surface, uint key, uint primitive, uint draw) {
    bool entering = dot(normal_, direction) < 0.0;
    vec3 n = entering ? -normal_ : normal_;
    // Duff et al. 2017, "Building an orthonormal basis, revisited".
    float sign_ = n.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (sign_ + n.z);
    float b = n.x * n.y * a;
    vec3 u1 = vec3(1.0 + sign_ * n.x * n.x * a, sign_ * b, -sign_ * n.x);
    vec3 u2 = vec3(b, sign_ + n.y * n.y * a, -n.y);
    vec3 drawn = n;
    bool faces = false;
    for (uint k = 0u; k < NORMALS && !faces; k++) {
        uvec4 bits = pcg4d(uvec4(key ^ sample_.seed.x, primitive, surface.hash ^ sample_.seed.y,
                                 2u * (draw * NORMALS + k) + uint(entering)));
        vec2 slopes = surface.roughness * normal_pair(bits.xy);
        drawn = normalize(n + slopes.x * u1 + slopes.y * u2);
        faces = dot(drawn, direction) > 0.0;
    }
    return faces ? drawn : n;
}

// Key of the normals that a ray without one draws.
uint key_of(Ray ray) {
    uvec4 bits = floatBitsToUint(vec4(ray.x, ray.z, ray.slope_x, ray.slope_z));
    return pcg4d(bits ^ pcg4d(uvec4(sample_.seed, ray.pose, 0u))).x;
}

// Change of slope of a ray at a rough surface from medium delta_i to delta_r; `reflected` if it stays in
// its medium. The facet decides on which side the ray is: one refracted back over the facet, or
// reflected but not away from it, draws again. `refracts`: the normal about which others are drawn, of
// the facet or of its smooth surface.
vec2 rough_bend(vec2 slope, vec3 normal_, vec3 refracts, Surface surface, uint key, uint primitive, float delta_i,
                float delta_r, out bool reflected) {
    vec3 ahead = dot(normal_, vec3(slope.x, 1.0, slope.y)) < 0.0 ? -normal_ : normal_;
    vec2 bend = vec2(0.0);
    bool behind = false; // in the medium behind the facet
    for (uint k = 0u; k < PASSES; k++) {
        vec2 now = slope + bend;
        vec3 direction = vec3(now.x, 1.0, now.y);
        float away = dot(ahead, direction);
        if (k > 0u && abs(away) > LEAVES && (away > 0.0) == behind) {
            reflected = !behind;
            return bend;
        }
        vec3 drawn = drawn_normal(refracts, direction, surface, key, primitive, k);
        bool turned_;
        bend += refract_slope(now, drawn, behind ? delta_r : delta_i, behind ? delta_i : delta_r,
                              turned_);
        if (!turned_) behind = !behind;
    }
    return refract_slope(slope, normal_, delta_i, delta_r, reflected);
}
