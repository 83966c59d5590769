"""Constants in a structure."""
