"""An export target of one's own, as the documentation has it: its block, and what it imports."""

from pathlib import Path

from condyle.cli.answer import Answer, command_line

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "extend.md"
_, _, _text = PAGE.read_text(encoding="utf-8").partition("## An export target")
_, _, _block = _text.partition("```text\n")
exec(_block.partition("```")[0], globals())
assert Answer and command_line
