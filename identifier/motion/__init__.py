"""The forward model: what a car with these tires does in a drive, and by how much it is missed."""
