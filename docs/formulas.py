"""Formulas of the pages, LaTeX between dollars, as MathML: the browser sets them by itself."""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert

INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)
BOLD = re.compile(r'<mi mathvariant="bold-italic">(&#x[0-9A-F]+;|\w)</mi>')
BAR = re.compile(r"<mo>(&#x0007C;|&#x02016;)</mo>")  # of a norm: else set like a relation
FUNCTION = re.compile(r"<m[io]>(sin|cos|det)</m[io]>")
# Bold italic letters of Unicode: first plain letter, last one, first bold one. Browsers know no
# `mathvariant` but "normal".
LETTERS = (("A", "Z", 0x1D468), ("a", "z", 0x1D482), ("Α", "Ω", 0x1D71C), ("α", "ω", 0x1D736))


class FormulaError(ValueError):
    """A formula that cannot be set."""


def with_formulas(page: str) -> str:
    """A page's HTML with its formulas, as `pymdownx.arithmatex` marks them, as MathML."""
    page = BLOCK.sub(lambda m: f'<div class="formula">{mathml(m[1], "block")}</div>', page)
    return INLINE.sub(lambda m: mathml(m[1], "inline"), page)


def mathml(latex: str, display: str = "inline") -> str:
    """One formula.

    Raises: FormulaError: for a command that is not known, or a brace that is not closed.
    """
    latex = html.unescape(latex).strip()
    braces = re.sub(r"\\\\|\\[{}]", "", latex)
    if braces.count("{") != braces.count("}"):
        raise FormulaError(f"{latex!r}: a brace is not closed")
    try:
        text = convert(latex, display=display)
    except Exception as error:  # the package has some twenty kinds
        raise FormulaError(f"{latex!r}: {type(error).__name__} {error}") from None
    if "\\" in text or re.search(r"<mi>&(amp;)?</mi>", text):
        raise FormulaError(f"{latex!r}: not all of it is known to latex2mathml: {text}")
    text = BOLD.sub(lambda m: f"<mi>{_bold(html.unescape(m[1]))}</mi>", text)
    text = BAR.sub(r'<mo lspace="0" rspace="0" stretchy="false">\1</mo>', text)
    return FUNCTION.sub(r'\g<0><mspace width="0.17em"/>', text)


def _bold(letter: str) -> str:
    for first, last, bold in LETTERS:
        if first <= letter <= last:
            return chr(bold + ord(letter) - ord(first))
    return letter
