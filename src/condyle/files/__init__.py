"""What is promised about files: read within limits, written complete or not at all."""
