"""What becomes of a disagreement: put down to a known deviation of Mitsuba, or shrunk and saved."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

from pmviewer.bench.agree.known import DEVIATIONS
from pmviewer.bench.agree.process import tools
from pmviewer.bench.agree.shrink import shrunk
from pmviewer.bench.agree.statistics import Outcome
from pmviewer.bench.agree.tree import Node, to_json
from pmviewer.bench.agree.trial import STAGES, Comparison, Question, Runs, questions
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


def _question(runs: Runs, like: Comparison) -> Question | None:
    return next((q for q in questions(runs) if (q.method, q.peer, q.what) == (like.method, like.peer, like.what)), None)


_recent: dict[tuple[str, tuple[int, ...]], tuple[Runs, tempfile.TemporaryDirectory[str]]] = {}
"""Scenes looked at last: several comparisons of one scene ask for the same pictures."""


def _runs(scene: Node, salt: tuple[int, ...]) -> Runs:
    """Raises PmviewerError when our loader refuses the scene."""
    key = (to_json(scene), salt)
    if key not in _recent:
        while len(_recent) >= MOST_KEPT:
            _recent.pop(next(iter(_recent)))[1].cleanup()
        folder, mitsuba, pool = tools()
        place = tempfile.TemporaryDirectory(dir=folder)
        _recent[key] = Runs(scene, Path(place.name), mitsuba, pool, salt), place
    return _recent[key][0]


def outcome_of(scene: Node, like: Comparison, stage: int, salt: tuple[int, ...]) -> Outcome | None:
    """The same comparison of another scene at a stage; None where it makes no sense or a program refuses the scene."""
    try:
        question = _question(_runs(scene, salt), like)
        return None if question is None else question.answer(stage)
    except PmviewerError:
        return None


def explained(scene: Node, found: Comparison, salt: tuple[int, ...]) -> Comparison:
    """The comparison with the known deviation that it comes from, if it may be a disagreement and does."""
    if found.p > DOUBTFUL:
        return found
    return replace(found, known=explanation(scene, found, AGREES, salt))


def explanation(scene: Node, found: Comparison, level: float, salt: tuple[int, ...]) -> str:
    """The known deviations that a disagreement comes from: without what they take, there is none.

    One alone if that is enough, else all that the scene has; empty if it disagrees without all of them too.
    """
    may = [d for d in DEVIATIONS if d.among_ours or found.peer.startswith("Mitsuba")]
    has = [(d.name, without) for d in may if (without := d.without(scene)) is not None]
    if not has:
        return ""
    bare = scene
    for deviation in may:
        bare = deviation.without(bare) or bare
    if not _agrees(bare, found, level, salt):
        return ""
    if len(has) > 1:
        for name, without in has:
            if _agrees(without, found, level, salt):
                return name
    return " + ".join(name for name, _ in has)


def without_all(scene: Node) -> Node:
    """The scene without what known deviations take; itself where it has nothing of the kind."""
    for deviation in DEVIATIONS:
        scene = deviation.without(scene) or scene
    return scene


def _agrees(scene: Node, like: Comparison, level: float, salt: tuple[int, ...]) -> bool:
    outcome = outcome_of(scene, like, len(STAGES) - 1, (*salt, 1))
    return outcome is not None and outcome.p > level


def smallest(scene: Node, found: Comparison, salt: tuple[int, ...], most: int) -> Node:
    """The smallest scene that shows the same disagreement."""
    brighter, size = found.outcome.ratio > 1, abs(found.outcome.ratio - 1)
    stage = 0  # the cheapest that shows it
    while stage < len(STAGES) - 1 and not _shows(outcome_of(scene, found, stage, (*salt, 3))):
        stage += 1

    def still(simpler: Node) -> bool:
        outcome = outcome_of(simpler, found, stage, (*salt, 2))
        if outcome is None or not _shows(outcome):
            return False
        return (outcome.ratio > 1) == brighter and abs(outcome.ratio - 1) >= LIKE * size

    return shrunk(scene, still, most)


def save(scene: Node, found: Comparison, folder: Path, name: str) -> Path:
    """Write the scene as XML and as the tree that it is, with what disagrees in it."""
    path, _ = write_scene(scene, folder, name)
    said = {"method": found.method, "peer": found.peer, "what": found.what, "p": found.outcome.p,
            "ratio": found.outcome.ratio}  # fmt: skip
    (folder / f"{name}.json").write_text(to_json({"scene": scene, "shows": said}) + "\n", encoding="utf-8")
    return path
