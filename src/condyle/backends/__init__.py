"""How a graph runs. These rooms know nothing of mechanics."""
