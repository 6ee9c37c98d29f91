"""The Frozen-Weight Reproducibility Test of the paper, by hand, with its control.

Three laws learn on the same slalom: integral, instantaneous, and instantaneous at η/λ. Frozen at
32 s they replay the past; how far they miss what they said online is what the paper looks at.
"""

from identifier.paper_study import LAWS, drive_maneuvers, paper_design, run_trial

EXPECTED_BELOW = 1.0


def main() -> float:
    """Return the frozen error of the integral law over that of the instantaneous law [-]."""
    slalom = drive_maneuvers()["slalom"]
    frozen = {}
    for law in LAWS:
        trial = run_trial(slalom, "slalom", paper_design(law, seed=0))
        past_against_online = trial.errors["past_against_online_32"]
        frozen[law] = trial.errors["against_truth_32"]
        print(
            f"{law:22} online {trial.errors['online']:.3f} kN, frozen at 32 s "
            f"{frozen[law]:.3f} kN against the truth, its past {past_against_online:.3f} kN "
            "against online"
        )
    return frozen["integral"] / frozen["instantaneous"]


if __name__ == "__main__":
    main()
