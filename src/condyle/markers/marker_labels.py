"""Which marker of a file a name means: spaces, letters and the subject's prefix forgiven."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import InputError, did_you_mean
from ..motion.file_words import listed


def find_label(name: str, labels: Sequence[str], where: str, what: str = "marker") -> int:
    """Index of the label that a name means, as "upper fl" means "Subject1:Upper_FL".

    The whole label goes before one without its prefix, and the same letters before others.

    Raises: InputError: if there is none, or several are meant.
    """
    for form in (str, _spaced, _folded, _bare, _bare_folded):
        found = [i for i, label in enumerate(labels) if label and form(label) == form(name)]
        if len(found) == 1:
            return found[0]
        if found:
            several = listed([labels[i] for i in found])
            alike = len({labels[i] for i in found}) < len(found)
            cure = "rename one of them in the file" if alike else "give the whole label"
            raise InputError(f'{where}: {what} "{name}" may be any of {several}; {cure}')
    present = [label for label in labels if label and not label.startswith("*")]
    raise InputError(f'{where}: has no {what} "{name}".{did_you_mean(name, present)}')


def _spaced(label: str) -> str:
    return " ".join(label.split())


def _folded(label: str) -> str:
    return "_".join(label.replace("_", " ").split()).casefold()


def _bare(label: str) -> str:
    return _spaced(label.rpartition(":")[2])


def _bare_folded(label: str) -> str:
    return _folded(label.rpartition(":")[2])
