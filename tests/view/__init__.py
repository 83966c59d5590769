"""The live view: its parts, and its page in a real browser."""
