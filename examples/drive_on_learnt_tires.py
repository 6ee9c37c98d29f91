"""Identify the tires of a sedan on a log, and drive a lane change with them.

The identified tires say how fast. The tracker is given them, then the linear ones of the vehicle
file; the car, its speed, the noise of its sensors and the delay are the same.
"""

import tireid as ti

EXPECTED_BELOW = 0.5


def main() -> float:
    """Return the rms deviation on identified tires over that on linear ones [-]."""
    car, path = ti.sedan(), ti.paths.iso_3888_2()
    tire = ti.identify(ti.sample_recording(car), car).tire
    speeds = ti.speed_profile(path, ti.speed_limits(tire), share=0.9, v_max=20.0)
    print(speeds)
    identified, linear = (ti.drive(path, car, one, speeds=speeds) for one in (tire, None))
    print(identified, linear, sep="\n")
    return identified.scores.rms_e_y_m / linear.scores.rms_e_y_m


if __name__ == "__main__":
    main()
