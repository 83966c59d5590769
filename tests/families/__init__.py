"""Chain families: against outside engines, against each other, and in their files."""
