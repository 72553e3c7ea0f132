"""The workers of a cluster as they come, go, freeze and thaw."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from pmviewer.engine.cluster.identity import is_other_processor, refusal

SILENT_AFTER = 6.0
"""Seconds without a heartbeat after which a worker gets nothing more to do; Dask's is one in a second or less, and
compiling may hold it up."""
Standing = Literal["asked", "ready", "refused"]


@dataclass
class Member:
    """A worker. `standing`: asked for its versions, found to be right, or refused."""

    address: str
    name: str
    threads: int
    standing: Standing = "asked"
    scenes: set[str] = field(default_factory=set)
    """Digests of those that it holds, as far as is known."""
    heard: float = 0.0
    """What the scheduler says of its last heartbeat, by its own clock."""
    changed: float = field(default_factory=time.monotonic)
    """When that has changed, by ours."""

    @property
    def is_near(self) -> bool:
        """Whether it may be on this machine, and see its memory."""
        return "://127.0.0.1:" in self.address

    @property
    def is_silent(self) -> bool:
        """Whether nothing was heard of it for some time: frozen, or cut off."""
        return time.monotonic() - self.changed > SILENT_AFTER

    @property
    def is_ready(self) -> bool:
        """Whether it can be given a pass."""
        return self.standing == "ready" and not self.is_silent


class Members:
    """`here` are the workers by address. `messages` are sentences for the user, in turn."""

    def __init__(self, mine: Mapping[str, str]) -> None:
        self.mine = mine
        self.here: dict[str, Member] = {}
        self.messages: list[str] = []
        self._said: set[str] = set()
        self._refusal = ""

    def update(self, workers: Mapping[str, Mapping[str, Any]]) -> list[Member]:
        """Take over what the scheduler says of its workers; returns those that are new."""
        new, now = [], time.monotonic()
        here = dict(self.here)
        for address in here.keys() - workers.keys():
            del here[address]
        for address, told in workers.items():
            member = here.get(address)
            if member is None:
                member = here[address] = Member(address, str(told.get("name", address)), int(told["nthreads"]))
                new.append(member)
            heard = float(told.get("last_seen", 0.0))
            if heard != member.heard:
                member.heard, member.changed = heard, now
        self.here = here
        return new

    def judge(self, member: Member, theirs: Mapping[str, str] | str) -> None:
        """By a worker's identity, or by the sentence in place of it: whether it may render."""
        if isinstance(theirs, str):
            said = f"Worker {member.address} can't render: {theirs}"
        elif different := refusal(self.mine, theirs):
            said = (
                f"Worker {member.address} gets no passes, as it might render another picture: {different}. Install the "
                "same versions in both places."
            )
        else:
            member.standing = "ready"
            if is_other_processor(self.mine, theirs):
                self.say_once(
                    "Workers have another processor than this machine: their passes may differ in the last bits from "
                    "those of this machine."
                )
            return
        member.standing = "refused"
        self._refusal = said
        self.say(said)

    def say(self, sentence: str) -> None:
        """For the user."""
        self.messages.append(sentence)

    def say_once(self, sentence: str) -> None:
        """For the user, unless it was said already."""
        if sentence not in self._said:
            self._said.add(sentence)
            self.say(sentence)

    def take_refusal(self) -> str:
        """The sentence about the worker that was refused last, which need not be said again."""
        self.messages = [said for said in self.messages if said != self._refusal]
        return self._refusal

    @property
    def ready(self) -> list[Member]:
        """Those that can be given a pass."""
        return [member for member in self.here.values() if member.is_ready]

    @property
    def refused(self) -> bool:
        """Whether there are workers, and all are refused."""
        return bool(self.here) and all(member.standing == "refused" for member in self.here.values())
