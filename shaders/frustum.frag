#version 330 core
uniform float size;
uniform float opacity;
flat in vec3 hue;
noperspective in float across; // pixels from the middle
out vec4 colour;

void main() {
    colour = vec4(hue, opacity * clamp(0.5 * size + 0.5 - abs(across), 0.0, 1.0));
}
