"""Numbers, vectors and colours in a scene file's attributes. Every function raises ValueError saying what it expected.

Text is matched strictly: Python's own `float` would also take "nan", "1_000" or Arabic digits.
"""

from __future__ import annotations

import re

from pmviewer.scene.description import RGB, Vec3

LARGEST = 1e30
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INTEGER = re.compile(r"[+-]?\d{1,18}", re.ASCII)
_SEPARATOR = re.compile(r"[\s,]+")


def quoted(text: str) -> str:
    """The text for an error message, cut to a readable length."""
    return repr(text if len(text) <= 40 else text[:37] + "…")


def parse_float(text: str) -> float:
    """A finite number of at most 1e30 in size."""
    text = text.strip()
    if not _NUMBER.fullmatch(text):
        raise ValueError(f"expected a number, found {quoted(text)}")
    value = float(text)
    if abs(value) > LARGEST:
        raise ValueError(f"expected a number between -{LARGEST:g} and {LARGEST:g}, found {quoted(text)}")
    return value


def parse_integer(text: str) -> int:
    """A whole number, also written as 64.0."""
    text = text.strip()
    if _INTEGER.fullmatch(text):
        return int(text)
    if _NUMBER.fullmatch(text) and abs(float(text)) < 1e15 and float(text).is_integer():
        return int(float(text))
    raise ValueError(f"expected a whole number, found {quoted(text)}")


def parse_boolean(text: str) -> bool:
    """true or false, in any case, or 1 or 0."""
    word = text.strip().lower()
    if word not in ("true", "false", "1", "0"):
        raise ValueError(f"expected true or false, found {quoted(text)}")
    return word in ("true", "1")


def parse_numbers(text: str, counts: tuple[int, ...]) -> list[float]:
    """As many numbers as one of `counts`, separated by spaces or commas."""
    words = [w for w in _SEPARATOR.split(text) if w]
    if len(words) not in counts:
        expected = " or ".join(map(str, counts))
        raise ValueError(f"expected {expected} numbers, found {len(words)} in {quoted(text)}")
    return [parse_float(w) for w in words]


def parse_vector(text: str) -> Vec3:
    """Three numbers, or one for all three."""
    numbers = parse_numbers(text, (1, 3))
    x, y, z = numbers * 3 if len(numbers) == 1 else numbers
    return (x, y, z)


def parse_rgb(text: str) -> RGB:
    """Linear RGB: three numbers, or one for grey."""
    return parse_vector(text)


def srgb_to_linear(value: float) -> float:
    """Decode one sRGB channel (IEC 61966-2-1)."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def parse_srgb(text: str) -> RGB:
    """sRGB-encoded colour, '#rrggbb' or three numbers in [0, 1], as linear RGB."""
    text = text.strip()
    if re.fullmatch(r"#[0-9a-fA-F]{6}", text):
        encoded = [int(text[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    else:
        encoded = list(parse_vector(text))
    if min(encoded) < 0 or max(encoded) > 1:
        raise ValueError(f"expected sRGB values between 0 and 1, found {quoted(text)}")
    r, g, b = map(srgb_to_linear, encoded)
    return (r, g, b)


def is_sampled(text: str) -> bool:
    """Is this spectrum a list of wavelength:value pairs?"""
    return ":" in text


def parse_samples(text: str) -> tuple[list[float], list[float]]:
    """Wavelengths in nm, increasing, and values of "wavelength:value, …"."""
    samples: dict[float, float] = {}
    for word in (w for w in _SEPARATOR.split(text) if w):
        wavelength, colon, value = word.partition(":")
        if not colon:
            raise ValueError(f"expected wavelength:value pairs, found {quoted(word)}")
        samples[parse_float(wavelength)] = parse_float(value)
    return in_order(list(samples), list(samples.values()))


def in_order(wavelengths: list[float], values: list[float]) -> tuple[list[float], list[float]]:
    """Both lists sorted by wavelength, if they are a spectrum."""
    if len(wavelengths) != len(values):
        raise ValueError(f"expected as many values as wavelengths, found {len(values)} and {len(wavelengths)}")
    if len(set(wavelengths)) < 2:
        raise ValueError("expected values at two wavelengths or more")
    pairs = sorted(dict(zip(wavelengths, values)).items())
    return [w for w, _ in pairs], [v for _, v in pairs]


def parse_list(text: str) -> list[float]:
    """Any number of numbers, separated by spaces or commas."""
    return [parse_float(w) for w in _SEPARATOR.split(text) if w]
