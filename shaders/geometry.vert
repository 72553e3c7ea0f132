#version 330 core
uniform mat4 view;
uniform mat4 projection;

in vec3 position;
in vec3 normal;
in vec3 albedo;

out vec3 eye_position;
out vec3 eye_normal;
out vec3 surface;

void main() {
    vec4 eye = view * vec4(position, 1.0);
    eye_position = projection[3][3] == 0.0 ? eye.xyz : vec3(0.0, 0.0, -1.0); // parallel rays: the light is far away
    eye_normal = mat3(view) * normal;
    surface = albedo;
    gl_Position = projection * eye;
}
