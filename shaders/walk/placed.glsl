// A placed shape with curved surfaces, and a line in the frame of the shape. Positions are sums of two
// f32 until the shape's own position is subtracted: after that few digits are needed.

// A line in the frame of a shape, and the way back.
struct ShapeLine {
    Twofold3 parameters; // as in AnalyticShape, of the scaled shape
    Twofold3 origin;     // where t = 0, in the plane y = y0 of the beam frame
    Twofold3 direction;  // per t; t is y - y0, m
    Twofold y0;          // of the shape's position
    Placed placed;
};

Twofold3 cross_product(vec3 u, Twofold3 v) {
    Twofold3 first = multiply(Twofold3(v.high.zxy, v.low.zxy), u.yzx);
    return subtract(first, multiply(Twofold3(v.high.yzx, v.low.yzx), u.zxy));
}

// A vector of the world in the frame of the shape. `norm`: the rotation's squared length over 2.
Twofold3 turned_back(Placed placed, Twofold norm, Twofold3 v) {
    Twofold3 first = cross_product(placed.rotation.xyz, v);
    Twofold3 second = cross_product(placed.rotation.xyz, first);
    Twofold3 sum = subtract(second, multiply(first, vec3(placed.rotation.w)));
    // Divided by the norm: one correction of the quotient.
    precise vec3 quotient = sum.high / norm.high;
    Twofold3 product = multiply(Twofold3(vec3(norm.high), vec3(norm.low)), quotient);
    precise vec3 rest = ((sum.high - product.high) - product.low) + sum.low;
    return add(v, two_sum(quotient, rest / norm.high));
}

Twofold half_norm(vec4 rotation) {
    Twofold3 squares = two_product(rotation.xyz, rotation.xyz);
    Twofold sum = add(two_product(rotation.w, rotation.w), twofold_x(squares));
    sum = add(add(sum, twofold_y(squares)), twofold_z(squares));
    return Twofold(0.5 * sum.high, 0.5 * sum.low);
}

// (x, y) from the world to the beam frame of a view with this sine; with its negative, the other way
// round.
void turn_by_view(inout Twofold3 v, float cosine, float sine) {
    Twofold3 along = multiply(v, vec3(cosine, cosine, 1.0));
    Twofold3 across = multiply(Twofold3(v.high.yxz, v.low.yxz), vec3(sine, -sine, 0.0));
    v = add(along, across);
}

// The line of a beam that is `moved` by (x, z) at y = 0, and `bent` by a change of slope.
ShapeLine shape_line(Beam beam, vec2 moved, vec2 bent, Placed placed) {
    AnalyticShape shape = shape_of(placed);
    Twofold3 position = Twofold3(placed.position, placed.rest);
    if (MOVED) {
        position = moved_from_world(beam.view, position);
    } else {
        turn_by_view(position, beam.cos_angle, beam.sin_angle);
    }
    Twofold y0 = twofold_y(position);
    Twofold3 slope = two_sum(vec3(beam.slope_x, 1.0, beam.slope_z), vec3(bent.x, 0.0, bent.y));
    Twofold3 start = two_sum(vec3(beam.x, 0.0, beam.z), vec3(moved.x, 0.0, moved.y));
    Twofold3 origin = add(start, multiply(slope, Twofold3(vec3(y0.high), vec3(y0.low))));
    origin = subtract(origin, position);
    if (MOVED) {
        origin = world_from_moved_direction(beam.view, origin);
        slope = world_from_moved_direction(beam.view, slope);
    } else {
        // Cosine and sine have rounding errors: a shape keeps its size.
        Twofold square = add(two_product(beam.cos_angle, beam.cos_angle),
                             two_product(beam.sin_angle, beam.sin_angle));
        float longer = 0.5 * ((square.high - 1.0) + square.low);
        turn_by_view(origin, beam.cos_angle, -beam.sin_angle);
        turn_by_view(slope, beam.cos_angle, -beam.sin_angle);
        origin.low.xy -= longer * origin.high.xy;
        slope.low.xy -= longer * slope.high.xy;
    }
    Twofold norm = half_norm(placed.rotation);
    ShapeLine line;
    line.origin = turned_back(placed, norm, origin);
    line.direction = turned_back(placed, norm, slope);
    line.y0 = y0;
    line.placed = placed;
    line.parameters = multiply(Twofold3(shape.high, shape.low), vec3(placed.scale));
    return line;
}

// y of the beam frame at t + left, rounded once.
float y_of(ShapeLine line, float t, float left) {
    Twofold sum = two_sum(line.y0.high, t);
    precise float y = sum.high + (sum.low + (line.y0.low + left));
    return y;
}

// A direction in the beam frame.
vec3 beam_from_shape(Beam beam, ShapeLine line, vec3 v) {
    vec4 q = line.placed.rotation;
    vec3 first = cross(q.xyz, v);
    v += 2.0 / dot(q, q) * (q.w * first + cross(q.xyz, first));
    return normalize(beam_from_world_direction(beam, v));
}
