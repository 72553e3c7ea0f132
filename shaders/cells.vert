#version 330 core
// Cells of projection maps (pmviewer/viewer/overlays/projection_maps.py).
uniform mat4 view;
uniform mat4 projection;

in vec3 position;
in vec2 corner; // of the cell, 0 to 1
in vec3 tint;

out vec2 place;
flat out vec3 hue;

void main() {
    place = corner;
    hue = tint;
    gl_Position = projection * view * vec4(position, 1.0);
}
