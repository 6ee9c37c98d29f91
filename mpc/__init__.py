"""What uses the learnt tires: paths, prediction with frozen weights, the tracker, closed loops."""
