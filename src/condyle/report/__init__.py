"""Tables, figures, the scene, the page."""
