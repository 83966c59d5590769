"""Section 3: rotation, contacts and parasitic motion, chains, closure, singularity."""
