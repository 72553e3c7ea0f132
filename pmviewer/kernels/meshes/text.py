"""Numbers in text, byte by byte: what mesh files of some hundred megabytes consist of."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel

SPACE, TAB, NEWLINE, RETURN, HASH = 32, 9, 10, 13, 35
_PLUS, _MINUS, _POINT, _ZERO, _NINE, _UPPER_E, _LOWER_E, _LOWER = 43, 45, 46, 48, 57, 69, 101, 32
_POWERS = 10.0 ** np.arange(23)
"""The powers of ten that float64 holds exactly."""
_MOST_DIGITS = 10**18


@device
def skip_blanks(data, i):
    """The first place from i on that is neither a space nor a tab."""
    while data[i] == SPACE or data[i] == TAB:
        i += 1
    return i


@device
def ends_line(c):
    """Whether the byte is a line feed or a carriage return, as old files end lines by."""
    return c in (NEWLINE, RETURN)


@device
def skip_word(data, i):
    """The first place from i on that is a blank or the end of a line."""
    while data[i] > SPACE:
        i += 1
    return i


@device
def next_line(data, i):
    """The place behind the next line end from i on."""
    while not ends_line(data[i]):
        i += 1
    return i + 1


@device
def scaled_by_ten(mantissa, exponent):
    """mantissa · 10^exponent: exact (Clinger 1990) for up to 15 digits and powers up to 22, else within some ulp."""
    value = np.float64(mantissa)
    if exponent > 330:
        return np.inf if mantissa > 0 else 0.0
    if exponent < -360:
        return 0.0
    while exponent > 22:
        value *= _POWERS[22]
        exponent -= 22
    while exponent < -22:
        value /= _POWERS[22]
        exponent += 22
    return value * _POWERS[exponent] if exponent >= 0 else value / _POWERS[-exponent]


@device
def number(data, i):
    """The decimal number that the word at i begins with and the place behind the word; NaN where there is none."""
    negative = data[i] == _MINUS
    if negative or data[i] == _PLUS:
        i += 1
    mantissa, exponent, digits = np.int64(0), 0, 0
    seen_point = False
    while True:
        c = data[i]
        if _ZERO <= c <= _NINE:
            digits += 1
            if mantissa < _MOST_DIGITS // 10:
                mantissa = mantissa * 10 + (np.int64(c) - _ZERO)
                exponent -= 1 if seen_point else 0
            else:
                exponent += 0 if seen_point else 1
        elif c == _POINT and not seen_point:
            seen_point = True
        else:
            break
        i += 1
    if digits > 0 and (data[i] == _LOWER_E or data[i] == _UPPER_E):
        j = i + 1
        below = data[j] == _MINUS
        if below or data[j] == _PLUS:
            j += 1
        power = 0
        while _ZERO <= data[j] <= _NINE:
            power = min(power * 10 + (np.int64(data[j]) - _ZERO), 100000)
            j += 1
            i = j
        exponent += -power if below else power
    end = skip_word(data, i)
    if digits == 0:
        # "inf", "-Infinity", "1.#INF" and "nan" in whatever spelling
        is_infinite = (data[i] | _LOWER) == 105 and (data[i + 1] | _LOWER) == 110 if end - i >= 3 else False
        value = np.inf if is_infinite else np.nan
    else:
        value = scaled_by_ten(mantissa, exponent)
    return (-value if negative else value), end


@kernel
def numbers(data, start, out):
    """Fill out (n,) float64 with the words from `start` on, wherever lines end; returns the place behind the last, and
    how many there were. `data` ends with a line end."""
    i, size = start, len(data)
    for k in range(len(out)):
        while i < size and data[i] <= SPACE:
            i += 1
        if i >= size:
            return i, k
        out[k], i = number(data, i)
    return i, len(out)
