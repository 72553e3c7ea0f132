"""What two pictures A and B differ by, as views in false colours (`pmviewer.output.difference` works them out)."""

from __future__ import annotations

from collections.abc import Mapping

from pmviewer.output.diagnostic_views import DiagnosticView

DIFFERENCES: Mapping[str, DiagnosticView] = {
    "signed": DiagnosticView(
        "difference", "luminance of A − B; blue: A is darker, orange: brighter", "W/(m² sr)", "", signed=True
    ),
    "absolute": DiagnosticView("difference", "|A − B|, mean of the channels", "W/(m² sr)", ""),
    "relative": DiagnosticView(
        "difference", "(A − B) / (B + 0.1) of luminances; blue: A is darker, orange: brighter", "", "", signed=True
    ),
    "relMSE": DiagnosticView(
        "difference", "(A − B)² / (B² + 0.01), mean of the channels", "", "", log=True, fixed=(1e-5, 1.0)
    ),
    "MAPE": DiagnosticView("difference", "|A − B| / (|B| + 0.1), mean of the channels", "%", ""),
    "FLIP": DiagnosticView(
        "difference", "HDR-FLIP, what is seen when the pictures alternate", "", "", fixed=(0.0, 1.0)
    ),
}
"""What each shows, as a view in false colours."""
