"""A car steered along a path by a tracker that is told of some tires; a drive to learn them on."""
