"""Indices that depend on the wavelength (T10).

Sellmeier's equation is n² = 1 + Σ Bᵢ λ²/(λ² − Cᵢ), Cauchy's n = A + B/λ², λ in micrometres. Coefficients by name are
published ones: Schott's data sheets (BK7, F2, SF10, SF11), Malitson 1965 (fused silica), Daimon and Masumura 2007
(water at 20 °C), Peter 1923 (diamond).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]

FRAUNHOFER_F, FRAUNHOFER_D, FRAUNHOFER_C = 486.1327, 587.5618, 656.2725
"""Wavelengths in nm that n_d and Abbe's number are taken at."""
SHORTEST, LONGEST = 380.0, 730.0
"""In nm, of what is seen: what lies outside adds less than a thousandth to any channel of white."""
LEAST_ABBE = 1.0
"""Optical glass has some 20 at least, rutile 10."""
LEAST_INDEX, LARGEST_INDEX = 1.0, 10.0


@dataclass(frozen=True)
class Dispersion:
    """How the index of a glass, against vacuum, depends on the wavelength. `coefficients`: B₁, B₂, …, C₁, C₂, … of
    Sellmeier's equation, or A, B of Cauchy's; `name` is empty for a glass without one."""

    formula: Literal["sellmeier", "cauchy"]
    coefficients: tuple[float, ...]
    name: str = ""

    def unbounded(self, nm: ArrayLike) -> Float:
        """What the equation gives at wavelengths in nm, which need not be an index: NaN where n² is negative."""
        square = (np.asarray(nm, np.float64) * 1e-3) ** 2
        with np.errstate(all="ignore"):
            if self.formula == "cauchy":
                a, b = self.coefficients
                return np.asarray(a + b / square)
            half = len(self.coefficients) // 2
            n2 = np.ones_like(square)
            for b, c in zip(self.coefficients[:half], self.coefficients[half:]):
                n2 = n2 + b * square / (square - c)
            return np.sqrt(n2)

    def index(self, nm: ArrayLike) -> Float:
        """Index at wavelengths in nm, from LEAST_INDEX to LARGEST_INDEX."""
        n = np.nan_to_num(self.unbounded(nm), nan=LEAST_INDEX, posinf=LARGEST_INDEX, neginf=LEAST_INDEX)
        return np.clip(n, LEAST_INDEX, LARGEST_INDEX)

    @property
    def n_d(self) -> float:
        """Index at the yellow line of helium."""
        return float(self.index(FRAUNHOFER_D))

    @property
    def abbe(self) -> float:
        """Abbe's number (n_d − 1)/(n_F − n_C); infinite for an index that is the same everywhere."""
        spread = float(self.index(FRAUNHOFER_F) - self.index(FRAUNHOFER_C))
        return (self.n_d - 1) / spread if spread else float("inf")

    @property
    def problem(self) -> str:
        """What is wrong with the index in the visible, "" if nothing is: the end of a sentence."""
        nm = np.linspace(SHORTEST, LONGEST, 351)
        n = self.unbounded(nm)
        wrong = ~((n >= LEAST_INDEX) & (n <= LARGEST_INDEX))
        if wrong.any():
            there = nm[wrong]
            return (
                f"has no index from {LEAST_INDEX:g} to {LARGEST_INDEX:g} between {there.min():.0f} and "
                f"{there.max():.0f} nm: it is cut to that"
            )
        if n[0] < n[-1]:
            return "bends red more than blue, as no clear glass does"
        return ""


def by_abbe(n_d: float, abbe: float) -> Dispersion:
    """Cauchy's equation through an index n_d and an Abbe number."""
    square = {line: (line * 1e-3) ** 2 for line in (FRAUNHOFER_F, FRAUNHOFER_D, FRAUNHOFER_C)}
    b = (n_d - 1) / abbe / (1 / square[FRAUNHOFER_F] - 1 / square[FRAUNHOFER_C])
    return Dispersion("cauchy", (n_d - b / square[FRAUNHOFER_D], b))


def _sellmeier(name: str, *coefficients: float) -> Dispersion:
    return Dispersion("sellmeier", coefficients, name)


_LISTED = (
    _sellmeier("BK7", 1.03961212, 0.231792344, 1.01046945, 0.00600069867, 0.0200179144, 103.560653),
    _sellmeier("F2", 1.34533359, 0.209073176, 0.937357162, 0.00997743871, 0.0470450767, 111.886764),
    _sellmeier("SF10", 1.62153902, 0.256287842, 1.64447552, 0.0122241457, 0.0595736775, 147.468793),
    _sellmeier("SF11", 1.73759695, 0.313747346, 1.89878101, 0.013188707, 0.0623068142, 155.23629),
    _sellmeier("fused silica", 0.6961663, 0.4079426, 0.8974794, 0.0684043**2, 0.1162414**2, 9.896161**2),
    _sellmeier("diamond", 0.3306, 4.3356, 0.1750**2, 0.1060**2),
    _sellmeier(
        "water",
        *(0.5684027565, 0.1726177391, 0.02086189578, 0.1130748688),
        *(0.005101829712, 0.01821153936, 0.02620722293, 10.69792721),
    ),
)
GLASSES: dict[str, Dispersion] = {glass.name.lower(): glass for glass in _LISTED}
"""By name in lower case. SF10, SF11 and BK7 are today's lead-free N-SF10, N-SF11 and N-BK7."""
_ALIASES = {"fused quartz": "fused silica", "quartz": "fused silica", "silica": "fused silica"}


def glass_named(name: str) -> Dispersion | None:
    """A glass by its name, in any case, with or without Schott's "N-"; None if it is not known."""
    plain = " ".join(name.lower().replace("_", " ").split()).removeprefix("n-")
    return GLASSES.get(_ALIASES.get(plain, plain))
