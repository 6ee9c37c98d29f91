"""The tires while the car drives: samples in, what is known of the car five times a second."""
