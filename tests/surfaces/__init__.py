"""Contact surfaces: equations, balls on walls, files, and the dynamics on them."""
