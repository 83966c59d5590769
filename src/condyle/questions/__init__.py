"""What can be asked: each question once, as expressions over chains as lanes."""
