#version 330 core
// A plane of the frame on the screen. The tone curves are those of pmviewer/output/tone.py.
uniform sampler2D plane;
uniform int content;      // 0 radiance, 1 reflectance, 2 unit vector, 3 depth, 5 a quantity in false colours,
                          // 6 cells, each with a colour of its own, 7 classes
uniform int curve;        // 0 sRGB, 1 Reinhard, 2 filmic, 3 linear
uniform float scale;      // 2^exposure
uniform vec2 depth_range; // nearest and farthest finite depth
uniform sampler2D colours; // of quantities, small to large (pmviewer/output/colour_maps.py): a table a row
uniform int colour_row;    // the table of quantities
uniform vec2 value_range;  // quantities at the ends of the colours, or their logarithms
uniform int value_log;     // whether they are
uniform int value_signed;  // whether values below zero tell something
uniform vec3 value_weights; // of the channels in the quantity
uniform vec3 grey;         // where there is nothing to tell: below zero
uniform vec3 class_colours[3];
uniform sampler2D shades;  // how much surfaces face the camera (pmviewer/output/shading.py)
uniform float shading;     // how much of that lies under false colours
uniform int marks;         // whether odd pixels are marked (pmviewer/output/marks.py)
uniform float cut;         // exposed radiance that the tone curve shows no differences beyond

in vec2 uv;
out vec4 colour;

vec3 srgb_oetf(vec3 x) {
    x = clamp(x, 0.0, 1.0);
    return mix(12.92 * x, 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, vec3(greaterThan(x, vec3(0.0031308))));
}

vec3 tone(vec3 x) {
    x = clamp(x * scale, 0.0, 1e15); // beyond, squares overflow
    if (curve == 1) return srgb_oetf(x / (1.0 + x));
    // Narkowicz' fit of the ACES film curve.
    if (curve == 2) return srgb_oetf(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14));
    if (curve == 3) return clamp(x, 0.0, 1.0);
    return srgb_oetf(x);
}

vec3 false_colour(float share, int row) {
    share = clamp(share, 0.0, 1.0);
    return texelFetch(colours, ivec2(int(share * float(textureSize(colours, 0).x - 1) + 0.5), row), 0).rgb;
}

// As in pmviewer/output/diagnostic_views.py; a half marks cells that are only the nearest, not near enough.
vec3 cell_colour(float cell) {
    uint h = uint(floor(cell));
    h = (h ^ (h >> 16u)) * 0x7FEB352Du;
    h = (h ^ (h >> 16u)) * 0x846CA68Bu;
    h ^= h >> 16u;
    vec3 hue = 0.25 + 0.75 * vec3(h & 255u, (h >> 8u) & 255u, (h >> 16u) & 255u) / 255.0;
    return fract(cell) > 0.25 ? 0.4 * hue : hue;
}

// 1 in diagonal stripes on the screen, else 0.
float stripes() {
    return step(4.0, mod(gl_FragCoord.x + gl_FragCoord.y, 8.0));
}

void main() {
    vec4 value = texture(plane, uv);
    if (any(isnan(value)) || any(isinf(value))) {
        colour = vec4(1.0, 0.0, 1.0, 1.0); // not a number: magenta, which nobody overlooks
        return;
    }
    vec3 shown;
    if (content == 0) {
        shown = tone(value.rgb);
        if (marks == 1) {
            if (any(greaterThan(value.rgb * scale, vec3(cut)))) shown = mix(shown, vec3(0.9, 0.1, 0.1), stripes());
            if (any(lessThan(value.rgb, vec3(0.0)))) shown = vec3(0.0, 1.0, 1.0);
        }
    } else if (content == 1) {
        shown = srgb_oetf(value.rgb);
    } else if (content == 2) {
        shown = value.rgb != vec3(0.0) ? value.rgb * 0.5 + 0.5 : vec3(0.0);
    } else if (content == 5) {
        float quantity = dot(value.rgb, value_weights);
        float at = value_log == 1 ? log(max(quantity, 1e-30)) : quantity;
        float share = (at - value_range.x) / (value_range.y - value_range.x);
        bool nothing = value_signed == 0 && quantity < 0.0;
        shown = nothing ? grey : false_colour(share, colour_row);
        if (marks == 1 && !nothing && (share < 0.0 || share > 1.0)) shown = mix(shown, vec3(share > 1.0), stripes());
    } else if (content == 6) {
        shown = value.r < 0.0 ? grey : cell_colour(value.r);
    } else if (content == 7) {
        shown = value.r < 0.0 ? grey : class_colours[clamp(int(value.r + 0.5), 0, 2)];
    } else {
        // Near is bright; pixels that see nothing are black.
        float span = max(depth_range.y - depth_range.x, 1e-30);
        shown = vec3(value.r > 0.0 ? 1.0 - 0.9 * clamp((value.r - depth_range.x) / span, 0.0, 1.0) : 0.0);
    }
    if (content >= 4) shown *= 1.0 + shading * (texture(shades, uv).r - 1.0);
    colour = vec4(shown, 1.0);
}
