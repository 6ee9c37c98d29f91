"""A car steered along a path by a tracker that is given of some tires; a drive to learn them on."""
