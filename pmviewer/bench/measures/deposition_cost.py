"""What a pass by deposition rules costs, over one that stores all photons (P20).

Passes are compared once all importons are traced. The first four trace them and cost more: 'CPU all' of the bench's
table has them. The rules take turns, so that what else the machine does meets all of them.
"""

from __future__ import annotations

from typing import Any

from pmviewer.bench.measures.deposited import CONTROL, KELLER_WALD, said, tell
from pmviewer.bench.report import Target
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.settings.access import Settings, with_values

SCENE = "office"
FIRST, PASSES, QUICK = 4, 8, 3
BOUNDS = {"density control": (CONTROL, 1.4), "Keller-Wald": (KELLER_WALD, 1.2)}


def costs(quick: bool, pool: WorkPool) -> list[Target]:
    """CPU seconds of a pass with density control and with Keller-Wald, over those of storing all, for both methods."""
    opened, targets = open_scene(SCENE), []
    for method in ("gather", "progressive"):
        renderers = {}
        for rule, changes in {"all": {}, **{rule: changes for rule, (changes, _) in BOUNDS.items()}}.items():
            settings = with_values(Settings(), {"render.method": method, **changes})
            prepare(opened, settings, pool, lambda text, share: None)
            renderers[rule] = Renderer(opened, settings, pool, StageStore(0))
            for _ in range(FIRST):
                renderers[rule].step()
        before = {rule: renderer.tally.cpu_seconds for rule, renderer in renderers.items()}
        passes = QUICK if quick else PASSES
        for _ in range(passes):
            for renderer in renderers.values():
                renderer.step()
        spent = {rule: (renderer.tally.cpu_seconds - before[rule]) / passes for rule, renderer in renderers.items()}
        for rule, (changes, bound) in BOUNDS.items():
            values: dict[str, Any] = {"render.method": method, **changes}
            note = f"{SCENE}, {said(values)}, passes {FIRST + 1} to {FIRST + passes}: {1000 * spent[rule]:.0f} over "
            note += f"{1000 * spent['all']:.0f} CPU ms"
            targets.append(Target("P20", spent[rule] / spent["all"], bound, "× a pass that stores all", False, note))
            tell(targets[-1].line())
    return targets
