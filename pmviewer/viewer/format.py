"""Numbers as people read them: thousands separators, SI prefixes, durations."""

from __future__ import annotations

import math

_PREFIXES = ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def grouped(value: int) -> str:
    """1234567 → 1,234,567."""
    return f"{value:,}"


def si(value: float, unit: str = "", digits: int = 3) -> str:
    """7432000 → 7.43 M; with a unit 0.0081, "m" → 8.10 mm."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g} {unit}".rstrip()
    magnitude = abs(value) * (1 + 0.5 * 10.0**-digits)  # 999.9 rounds up to the next prefix
    factor, prefix = next((p for p in _PREFIXES if magnitude >= p[0]), _PREFIXES[-1])
    scaled = value / factor
    whole = len(str(int(abs(scaled)))) if abs(scaled) >= 1 else 1
    decimals = max(0, digits - whole) if (factor != 1.0 or not float(value).is_integer()) else 0
    return f"{scaled:.{decimals}f} {prefix}{unit}".rstrip()


def duration(seconds: float) -> str:
    """Milliseconds, seconds, minutes or hours, whichever reads best."""
    if seconds < 1:
        return f"{seconds * 1e3:.0f} ms"
    if seconds < 100:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min"


def data_size(count: float) -> str:
    """Bytes with binary prefixes."""
    for prefix in ("B", "KiB", "MiB", "GiB"):
        if count < 1024 or prefix == "GiB":
            return f"{count:.0f} {prefix}" if prefix == "B" else f"{count:.1f} {prefix}"
        count /= 1024
    raise AssertionError


def short(value: float) -> str:
    """A float of four significant digits without noise."""
    text = f"{value:.4g}"
    return text if "e" not in text or abs(value) < 1e-4 else f"{value:,.0f}"
