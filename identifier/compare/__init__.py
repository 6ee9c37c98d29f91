"""Methods beside each other: the course, batches and sweeps of runs, the study and its floors."""
