// The colour of a photon as it is stored (pmviewer/maps/record.py).
uniform int colour_by;      // 0 power, 1 bounces, 2 light, 3 lit or in shadow, 4 a channel in false colours, 5 fate,
                            // 6 wavelength, 7 direction
uniform int channel;        // of 4: red, green, blue, or (3) the mean of green and blue
uniform int colour_row;     // of 4: small to large, or (1) around a middle
uniform vec3 false_colours[32]; // sixteen of either table
uniform vec3 fate_palette[4];
uniform vec2 power_range;   // logarithms (base 2) of the brightest channel, dim and bright end
uniform vec3 bounce_palette[8];
uniform vec3 light_palette[8];
uniform vec3 wave_palette[64]; // of photons without a wavelength, and of the bands of the spectrum
uniform vec3 lit_colour;
uniform vec3 shadow_colour;

const uint HAD_DIFFUSE = 0x40u; // of a shadow photon: the light does not arrive

float decode(uint code) {
    return code == 0u ? 0.0 : uintBitsToFloat((code << 13u) + (80u << 23u));
}

vec3 false_hue(float level) {
    float at = clamp(level, 0.0, 1.0) * 15.0;
    int first = min(int(at), 14);
    return mix(false_colours[16 * colour_row + first], false_colours[16 * colour_row + first + 1], at - float(first));
}

vec3 came_from(uint direction_and_flags) {
    float u = (float(direction_and_flags >> 20u) - 2047.0) / 2047.0;
    float v = (float(direction_and_flags >> 8u & 0xFFFu) - 2047.0) / 2047.0;
    float z = 1.0 - abs(u) - abs(v), t = max(-z, 0.0);
    return normalize(vec3(u - (u >= 0.0 ? t : -t), v - (v >= 0.0 ? t : -t), z));
}

vec3 photon_hue(uint direction_and_flags, uvec2 power_and_light) {
    uint flags = direction_and_flags & 255u;
    if (colour_by == 7) return 0.5 + 0.5 * came_from(direction_and_flags);
    if (colour_by == 1) return bounce_palette[min(int(flags & 63u), 7)];
    if (colour_by == 2) return light_palette[int((power_and_light.y >> 16u) % 8u)];
    if (colour_by == 5) return fate_palette[int((power_and_light.y >> 16u) & 3u)];
    if (colour_by == 6) {
        uint red_green = power_and_light.x;
        uint band = (red_green & 3u) | ((red_green >> 16u & 3u) << 2u) | ((power_and_light.y & 3u) << 4u);
        return wave_palette[int(band)];
    }
    if (colour_by == 3) return (flags & HAD_DIFFUSE) != 0u ? shadow_colour : lit_colour;
    vec3 power = vec3(decode(power_and_light.x & 0xFFFFu), decode(power_and_light.x >> 16u),
                      decode(power_and_light.y & 0xFFFFu));
    if (colour_by == 4) {
        float value = channel == 3 ? 0.5 * (power.g + power.b) : power[channel];
        return false_hue((log2(max(value, 1e-30)) - power_range.x) / max(power_range.y - power_range.x, 1e-3));
    }
    float peak = max(max(power.r, power.g), power.b);
    float level = clamp((log2(max(peak, 1e-30)) - power_range.x) / max(power_range.y - power_range.x, 1e-3), 0.0, 1.0);
    return peak > 0.0 ? pow(power / peak, vec3(1.0 / 2.2)) * mix(0.55, 1.0, level) : vec3(0.35);
}
