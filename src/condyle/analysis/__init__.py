"""What results mean side by side: indices, comparisons of models, the paper's numbers."""
