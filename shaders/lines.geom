#version 330 core
// A line as a strip of the width asked for: core OpenGL promises no lines wider than a pixel.
layout(lines) in;
layout(triangle_strip, max_vertices = 4) out;
uniform vec2 viewport; // pixels
uniform float size;    // pixels

in vec3 end_hue[];
flat out vec3 hue;
noperspective out float across; // pixels from the middle
noperspective out float along;  // 0 to 1

void main() {
    vec4 a = gl_in[0].gl_Position, b = gl_in[1].gl_Position;
    const float NEAR = 1e-6;
    // Behind the eye there is no place on the screen: cut the line where it passes.
    if (a.w < NEAR && b.w < NEAR) return;
    if (a.w < NEAR) a = mix(a, b, (NEAR - a.w) / (b.w - a.w));
    if (b.w < NEAR) b = mix(b, a, (NEAR - b.w) / (a.w - b.w));
    vec2 way = (b.xy / b.w - a.xy / a.w) * viewport;
    float length_ = length(way);
    vec2 side = length_ > 0.0 ? vec2(-way.y, way.x) / length_ : vec2(1.0, 0.0);
    float half_width = 0.5 * size + 0.5; // half a pixel to fade out in
    vec2 offset = side * 2.0 * half_width / viewport;
    for (int i = 0; i < 4; ++i) {
        vec4 end = i < 2 ? a : b;
        float sign_ = (i & 1) == 0 ? -1.0 : 1.0;
        hue = end_hue[1];
        across = sign_ * half_width;
        along = i < 2 ? 0.0 : 1.0;
        gl_Position = vec4(end.xy + sign_ * offset * end.w, end.zw);
        EmitVertex();
    }
    EndPrimitive();
}
