#version 330 core
uniform vec3 low;
uniform vec3 high;
flat in float bright;
out vec4 colour;

void main() {
    vec2 offset = gl_PointCoord * 2.0 - 1.0;
    if (dot(offset, offset) > 1.0) discard;
    colour = vec4(mix(low, high, bright), 1.0);
}
