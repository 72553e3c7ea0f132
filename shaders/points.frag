#version 330 core
uniform int round_points;
flat in vec3 hue;
out vec4 colour;

void main() {
    if (round_points == 1) {
        vec2 offset = gl_PointCoord * 2.0 - 1.0;
        if (dot(offset, offset) > 1.0) discard;
    }
    colour = vec4(hue, 1.0);
}
