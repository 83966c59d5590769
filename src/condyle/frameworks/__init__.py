"""Models as pure functions of JAX, PyTorch and CasADi, by our own C, with exact derivatives."""
