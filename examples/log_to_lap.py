"""From a log to a lap: identify the tires, plan the fastest speed that they allow, drive it.

The plan sees nothing of the true tires of the simulated car; their uncertainty is its margin.
Writes lap.csv, raceline.csv and log_to_lap.png.
"""

import numpy as np

import tireid as ti

EXPECTED_BELOW = 0.3  # m


def main() -> float:
    """Return the largest deviation from the path on the planned lap [m]."""
    car = ti.sedan()
    run = ti.identify(ti.sample_recording(car), car)
    print(run.verdict.headline)

    limits = ti.speed_limits(run.tire)
    path = ti.paths.handling_course()  # or ti.paths.Path.from_csv("raceline.csv")
    profile = ti.speed_profile(path, limits, engine=4.0, brakes=8.0)
    print(limits, profile, sep="\n")
    print(f"largest share of the limits: {profile.used.max():.2f}")
    for reason in np.unique(profile.limited_by):
        print(f"{reason}: {100.0 * np.mean(profile.limited_by == reason):.0f} % of the way")
    profile.to_csv("lap.csv")
    profile.to_csv("raceline.csv", tum=True)
    ti.plot(profile).savefig("log_to_lap.png")

    driven = ti.drive(path, car, run.tire, speeds=profile)
    print(driven)
    return float(driven.scores.peak_e_y_m)


if __name__ == "__main__":
    main()
