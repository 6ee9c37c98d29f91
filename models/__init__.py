"""What is true: parameters, tires, bicycle, plant, maneuvers, sensors and recordings."""
