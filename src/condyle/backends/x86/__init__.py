"""A batch as x86-64 assembly: lowered, ordered, given registers, printed."""
