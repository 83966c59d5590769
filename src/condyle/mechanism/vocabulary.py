"""The words of a machine: the one table through which headings, notes and messages pass.

A file with `vocabulary = "jaw"` gets the words of a clinic. Columns, keys and names keep theirs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import cache
from typing import Literal, NamedTuple, Protocol

Vocabulary = Literal["jaw"]


class Words(NamedTuple):
    """What is said in the place of a whole text, and of words within one."""

    complete: dict[str, str]
    within: dict[str, str]


_MUSCLES = Words(
    complete={
        "Actuators": "Activation",
        "coordinate": "shortening",
        "joint": "shortening",
        "Effort against speed, the data for choosing a motor.": "Force against speed.",
    },
    within={
        "joint coordinates": "shortening",
        "joint travel": "shortening",
        "joint speed": "speed of shortening",
        "joint acceleration": "acceleration of shortening",
        "contact points": "joints",
        "contact point": "joint",
        "contacts": "joints",
        "contact": "joint",
        "chains": "muscles",
        "chain": "muscle",
        "actuators": "muscles",
        "actuator": "muscle",
        "motors": "muscles",
        "motor": "muscle",
        "efforts": "forces",
        "effort": "force",
    },
)
_JAW = Words(
    complete=_MUSCLES.complete
    | {
        "X": "forward (X)",
        "Y": "left (Y)",
        "Z": "up (Z)",
        "alpha": "tilt (alpha)",
        "beta": "opening (beta)",
        "gamma": "turn (gamma)",
    },
    within=_MUSCLES.within
    | {
        "platform": "jaw",
        "contact forces": "joint loads",
        "contact force": "joint load",
        "loses contact": "loses contact",
        "contact loss": "loss of contact",
        "platform joints": "attachments",
        "platform joint": "attachment",
        "actuation redundancy": "redundancy of muscles",
        "singular values": "singular values",
        "singular value": "singular value",
        "singularity at home": "lever arms at home",
        "direct singularity": "loss of lever arms",
        "inverse singularity": "loss of lever arms",
        "singularities": "losses of lever arms",
        "singularity": "loss of lever arms",
        "singular": "without lever arms",
    },
)
VOCABULARIES: dict[str, Words] = {"muscles": _MUSCLES, "jaw": _JAW}
# What is no prose: quoted names, options, headings and paths of a file.
_AS_IT_IS = r'"[^"]*"|`[^`]*`|--[\w-]+|\[\[\w+\]\]|\w+\.\w[\w.]*'


class _Driven(Protocol):
    @property
    def kind(self) -> str: ...


class SpokenOf(Protocol):
    """A mechanism, as far as its words go."""

    @property
    def vocabulary(self) -> Vocabulary | None: ...
    @property
    def chains(self) -> Sequence[_Driven]: ...


def of_muscles(mechanism: SpokenOf) -> bool:
    """Whether the chains are muscles: all only pull, and by a chain's kind, or by the file's
    vocabulary, that is what they are."""
    kinds = {chain.kind for chain in mechanism.chains}
    return kinds <= {"cable", "muscle"} and ("muscle" in kinds or mechanism.vocabulary == "jaw")


def words_of(mechanism: SpokenOf) -> Callable[[str], str]:
    """What says a text in the words of a mechanism.

    Where muscles drive it: muscle, joint and force in the place of chain, contact and effort; of a
    jaw also joint load, gape and the like. Else the text stays as it is.
    """
    name = mechanism.vocabulary or ("muscles" if of_muscles(mechanism) else None)
    return str if name is None else _say(name)


@cache
def _say(vocabulary: str) -> Callable[[str], str]:
    complete, within = VOCABULARIES[vocabulary]
    phrases = "|".join(sorted(within, key=len, reverse=True))
    pattern = re.compile(rf"({_AS_IT_IS})|\b(an? )?({phrases})\b", re.IGNORECASE)

    def word(found: re.Match[str]) -> str:
        kept, article, phrase = found.groups()
        if kept:
            return kept
        text = within[phrase.lower()]
        if article:
            article = article[0] + ("n " if text[0] in "aeiou" else " ")
        return (article or "") + (text[0].upper() + text[1:] if phrase[0].isupper() else text)

    return lambda text: complete.get(text) or pattern.sub(word, text)
