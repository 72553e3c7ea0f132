"""What becomes of a disagreement: put down to a known deviation of Mitsuba, or shrunk and saved."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

from pmviewer.bench.agree.known import DEVIATIONS
from pmviewer.bench.agree.process import tools
from pmviewer.bench.agree.shrink import shrunk
from pmviewer.bench.agree.statistics import Outcome
from pmviewer.bench.agree.tree import Node, from_json, to_json
from pmviewer.bench.agree.trial import STAGES, Comparison, Explain, Question, Runs, questions
from pmviewer.bench.agree.xml import write_scene
from pmviewer.errors import PmviewerError

CLEAR = 1e-4
"""p at which a simpler scene still shows the disagreement: some hundred tries shall not end at a chance."""
DOUBTFUL = 1e-4
"""p above which a comparison is no disagreement in any run of more than a hundred comparisons."""
AGREES = 1e-6
"""p from which a scene without what is known agrees: that of one comparison among some ten thousand."""
MOST_KEPT = 6
LIKE = 0.3
"""Least share of the deviation in a simpler scene: another, smaller difference is not the one that is looked for."""


def _shows(outcome: Outcome | None) -> bool:
    return outcome is not None and outcome.p <= CLEAR


def _question(runs: Runs, like: Comparison, believed: bool) -> Question | None:
    return next(
        (q for q in questions(runs, believed) if (q.method, q.peer, q.what) == (like.method, like.peer, like.what)),
        None,
    )


_recent: dict[tuple[str, tuple[int, ...], bool], tuple[Runs, tempfile.TemporaryDirectory[str]]] = {}
"""Scenes looked at last: several comparisons of one scene ask for the same pictures."""


def _runs(scene: Node, salt: tuple[int, ...], shared_kernels: bool) -> Runs:
    """Raises PmviewerError when our loader refuses the scene."""
    key = (to_json(scene), salt, shared_kernels)
    if key not in _recent:
        while len(_recent) >= MOST_KEPT:
            _recent.pop(next(iter(_recent)))[1].cleanup()
        folder, mitsuba, pool = tools()
        place = tempfile.TemporaryDirectory(dir=folder)
        _recent[key] = Runs(scene, Path(place.name), mitsuba, pool, salt, shared_kernels), place
    return _recent[key][0]


def outcome_of(
    scene: Node,
    like: Comparison,
    stage: int,
    salt: tuple[int, ...],
    shared_kernels: bool = False,
    believed: bool = False,
) -> Outcome | None:
    """The same comparison of another scene at a stage; None where it makes no sense or a program refuses the scene.
    `believed` as for `questions`."""
    try:
        question = _question(_runs(scene, salt, shared_kernels), like, believed)
        return None if question is None else question.answer(stage)
    except PmviewerError:
        return None


def all_explained(
    scene: Node, comparisons: list[Comparison], salt: tuple[int, ...], shared_kernels: bool = False
) -> list[Comparison]:
    """The comparisons with the known deviation that each comes from, if it may be a disagreement and does."""
    found: list[Comparison] = []
    for comparison in comparisons:
        if comparison.p <= DOUBTFUL and not comparison.known:
            before = tuple(dict.fromkeys(c.known for c in found if c.known))
            comparison = replace(comparison, known=explanation(scene, comparison, salt, shared_kernels, before))
        found.append(comparison)
    return found


def explainer(scene: Node, salt: tuple[int, ...], shared_kernels: bool = False) -> Explain:
    """What `Question.asked` asks of a scene: `explanation` of what may be a disagreement, reasons found before
    first."""
    said: dict[str, None] = {}

    def explain(comparison: Comparison) -> str:
        known = "" if comparison.p > DOUBTFUL else explanation(scene, comparison, salt, shared_kernels, tuple(said))
        if known:
            said[known] = None
        return known

    return explain


def explanation(
    scene: Node, found: Comparison, salt: tuple[int, ...], shared_kernels: bool = False, first: tuple[str, ...] = ()
) -> str:
    """The known deviations that a disagreement comes from: without what they take, there is none.

    One alone if that is enough, those that are named `first` before others; else all that the scene has; empty if it
    disagrees without all of them too.
    """

    def agrees(simpler: Node) -> bool:
        # With what was enough to find the disagreement, and other seeds. Particles that lose light here don't agree;
        # whether they do, the few of the first stage that are asked otherwise can't tell from their noise.
        outcome = outcome_of(simpler, found, found.stage - 1, (*salt, 1), shared_kernels, believed=True)
        return outcome is not None and outcome.p > AGREES

    may = [d for d in DEVIATIONS if d.concerns(found.peer)]
    has = {d.name: without for d in may if (without := d.without(scene)) is not None}
    for name in sorted(has, key=lambda name: name not in first):
        if agrees(has[name]):
            return name
    bare = scene
    for deviation in may:
        bare = deviation.without(bare) or bare
    return " + ".join(has) if len(has) > 1 and agrees(bare) else ""


def without_all(scene: Node) -> Node:
    """The scene without what known deviations take; itself where it has nothing of the kind."""
    for deviation in DEVIATIONS:
        scene = deviation.without(scene) or scene
    return scene


def smallest(scene: Node, found: Comparison, salt: tuple[int, ...], most: int) -> Node:
    """The smallest scene that shows the same disagreement, by the kernels for all kinds of surfaces where these show it
    too: others would be compiled for each simpler scene."""
    brighter, size = found.outcome.ratio > 1, abs(found.outcome.ratio - 1)
    last = len(STAGES) - 1
    ways = [(stage, True) for stage in range(last + 1)] + [(stage, False) for stage in range(last + 1)]
    shown = (way for way in ways if _shows(outcome_of(scene, found, way[0], (*salt, 3), way[1])))
    stage, shared = next(shown, (last, True))  # the cheapest that shows it

    def still(simpler: Node) -> bool:
        outcome = outcome_of(simpler, found, stage, (*salt, 2), shared)
        if outcome is None or not _shows(outcome):
            return False
        return (outcome.ratio > 1) == brighter and abs(outcome.ratio - 1) >= LIKE * size

    return shrunk(scene, still, most)


def save(scene: Node, found: Comparison, folder: Path, name: str) -> Path:
    """Write the scene as XML and as the tree that it is, with what disagrees in it."""
    path, _ = write_scene(scene, folder, name)
    text = to_json({"scene": scene, "shows": _said(found)})
    (folder / f"{name}.json").write_text(text + "\n", encoding="utf-8")
    return path


def saved(found: Comparison, folder: Path, name: str) -> Path | None:
    """The XML file that `save` has made of the very same comparison, if there is one."""
    try:
        said = from_json((folder / f"{name}.json").read_text("utf-8"))["shows"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    path = folder / f"{name}.xml"
    return path if said == _said(found) and path.is_file() else None


def _said(found: Comparison) -> Node:
    outcome = found.outcome
    return {"method": found.method, "peer": found.peer, "what": found.what, "p": outcome.p, "ratio": outcome.ratio}
