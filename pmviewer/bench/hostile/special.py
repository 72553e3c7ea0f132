"""Hostile files that are not mutations: bombs, extremes of counts and of nesting, references to what is no file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

Files = dict[str, bytes]


@dataclass(frozen=True)
class Special:
    """`files` of bytes; names in `fifos` are made as pipes, those in `links` as symbolic links (name: target)."""

    format: str
    main: str
    files: Files
    fifos: tuple[str, ...] = ()
    links: dict[str, str] = field(default_factory=dict)


Maker = Callable[[], Special]
