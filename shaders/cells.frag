#version 330 core
uniform float opacity;
in vec2 place;
flat in vec3 hue;
out vec4 colour;

void main() {
    vec2 off = min(place, 1.0 - place) / fwidth(place); // pixels from the cell's edges
    float edge = 1.0 - clamp(min(off.x, off.y), 0.0, 1.0);
    colour = vec4(hue * mix(1.0, 0.55, edge), mix(opacity, min(1.0, opacity + 0.3), edge));
}
