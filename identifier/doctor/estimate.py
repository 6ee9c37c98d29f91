"""The faults of a log and of what is told of its car, estimated together, with no tire known.

One fault after the other is taken in, the one that explains most, as long as it explains more than
chance and the model do; then all of them are estimated together. Faults that explain nearly as
much are named beside it: this drive cannot tell them apart.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identifier.doctor.balance import BANKS, DOWNFORCE, Balance, Sizes
from identifier.doctor.finding import Finding
from identifier.doctor.fit import Fit, Fitter, Outlook
from identifier.doctor.pieces import stretches_of
from identifier.doctor.suspects import SUSPECTS, Suspect
from models.recordings import Recording, Repair
from models.vehicle import AREAS, Vehicle, VehicleError

LONGEST, PIECES = 60.0, 4  # s that are looked at, and from how many parts of a longer log
FEWEST = 24  # windows, below which nothing is asked
MOST = 4  # faults at once
CHANCE = 4.5  # gain of J that a fault must bring
TELLING = 2.5  # deviations, with the least size of the suspect in them, that it must have
ALIKE = 3.0  # gain of J within which two faults cannot be told apart
LIKELY, HOPELESS = 8, 0.5  # suspects that are looked at closely, from this share of CHANCE on
PROMISING = 12  # that are looked at closely then, by the sizes that were tried
AWRY = 9.0  # mean square of a part, from which straight lines promise nothing: all are looked at
BEYOND = 20.0  # mean square of a part with all that was found, from which nothing was understood
GIVEN_UP_WITH, GIVEN_UP_FROM = 2, 40.0  # faults and the same, from which no other is asked for
UNEXPLAINED = (
    "no tire explains the front axle, whichever of them is taken out: a steering angle that was "
    "commanded and not measured, play, or several faults at once",
    "no tire explains the rear axle, whichever of them is taken out",
    "v_x, v_y, r and a_y contradict each other, whichever of them is taken out",
)  # of each part
TEMPER = 2.0  # odds of e per this gain of J: the model is not exact
UNSEEN = 0.6  # of what is believed beforehand is left by a drive that tells next to nothing
SURE = 0.95  # confidence, from which a fault of which no other is like is taken out unasked
STANDS = 1.5  # deviations of a real log, that what is sure must have
STAYS = 2.0  # deviations by which what is sure may move where the rest is left out
SEVERAL = 2  # faults at once, beyond which none is sure: rather a motion that the model lacks
BELIEVED = 3.5  # plausible sizes, beyond which nobody believes one


class Candidate(NamedTuple):
    """A suspect, its fit beside what is already there, and what it gains of J."""

    suspect: Suspect
    fit: Fit
    gain: float


class Found(NamedTuple):
    """A fault that was taken in, and those that this drive cannot tell from it."""

    suspect: Suspect
    gain: float
    alike: tuple[Candidate, ...]


class Search:
    """The search for what is wrong with one drive."""

    def __init__(self, balance: Balance) -> None:
        self.balance, self.vehicle = balance, balance.vehicle
        self.fitter = Fitter(balance)
        self.suspects = [
            one for one in SUSPECTS if balance.has_accelerometer or "a_y" not in one.channel
        ]
        self.found: list[Found] = []
        self.in_doubt = False  # whether what would leave no car explained more than a found one
        self.fit = self.fitter.fit((), {})

    def keys(self, suspect: Suspect) -> list[str]:
        """Return the keys of its sizes."""
        match suspect.code:
            case "bank":
                return [f"bank.{k}" for k in range(BANKS if self.balance.has_accelerometer else 1)]
            case "downforce":
                return [*DOWNFORCE]
        return [suspect.key]

    @property
    def chosen(self) -> list[str]:
        """Keys of what was taken in."""
        return [key for one in self.found for key in self.keys(one.suspect)]

    def size(self, suspect: Suspect, sizes: Sizes) -> float:
        """Return the size of a suspect: of a bank, its rms over the drive, of downforce, the
        mean.
        """
        if suspect.code == "downforce":
            shares = np.array(self.vehicle.axle_loads) / self.vehicle.weight
            return float(shares @ [sizes[key] for key in DOWNFORCE])
        if suspect.code != "bank":
            return sizes[suspect.key]
        swings = np.array([sizes.get(f"bank.{k}", 0.0) for k in range(BANKS)])
        angle = self.balance.banks @ swings
        return math.copysign(math.sqrt(float(np.mean(angle**2))), float(np.mean(angle)))

    def deviation(self, suspect: Suspect, fit: Fit) -> float:
        """Return the standard deviation of a suspect's size, with what no model tells."""
        return math.hypot(fit.deviation(self.keys(suspect)[0]), self.least(suspect))

    def least(self, suspect: Suspect) -> float:
        """Return the size of a suspect that nobody need mend, on this car [SI]."""
        return suspect.least * suspect.scale(self.vehicle)

    def real_deviation(self, suspect: Suspect, fit: Fit) -> float:
        """Return the same of a real log, in which all else is a little off.

        A real log has each other fault too, as large as its `least`: small delays, scales and
        offsets that nobody looks for shift what is estimated without them, each in its own way.
        """
        left = [one for one in self.suspects if self.keys(one)[0] not in fit.sizes]
        least = {
            key: self.least(one) / math.sqrt(len(self.keys(one)))
            for one in left
            for key in self.keys(one)
        }
        moved = self.fitter.moved(fit, least)[self.keys(suspect)[0]]
        return math.hypot(self.deviation(suspect, fit), moved)

    def outlook(self) -> tuple[list[Suspect], dict[str, Outlook]]:
        """Return the suspects that were not taken in, and what each promises, by its key."""
        chosen = self.chosen
        left = [one for one in self.suspects if self.keys(one)[0] not in chosen]
        return left, self.fitter.outlook(self.fit, {one.key: self.keys(one) for one in left})

    def unseen(self) -> tuple[str, ...]:
        """Return what this drive tells next to nothing of, beside what was found, a line each."""
        left, outlook = self.outlook()
        lines = []
        for one in left:
            unknown = outlook[one.key].left
            if unknown > UNSEEN:
                plausible = unknown * one.plausible * one.scale(self.vehicle)
                least = f"{plausible * one.per_unit:.2g}{one.shown}"
                if one.is_factor:
                    least = f"a factor of {math.exp(plausible):.2g}"
                name = f"{one.code.replace('_', ' ')} {one.channel}".strip()
                lines.append(f"{name}: {least} would not be seen on this drive")
        return tuple(lines)

    def candidates(self) -> list[Candidate]:
        """Return the suspects beside what is there already, the one that gains most first."""
        left, outlook = self.outlook()
        likely = sorted(left, key=lambda one: -outlook[one.key].gain)
        awry = max(self.fit.misses) > AWRY
        if not awry:
            likely = likely[:LIKELY]
            likely = [one for one in likely if outlook[one.key].gain > HOPELESS * CHANCE]
        starts = {one.key: self.fit.sizes for one in likely}
        if awry:
            tried = {
                one.key: self.fitter.best_start(self.fit.sizes, self.keys(one)[0]) for one in likely
            }
            likely = sorted(likely, key=lambda one: tried[one.key][0])[:PROMISING]
            starts = {one.key: tried[one.key][1] for one in likely}
        return self._ranked([self._candidate(one, starts[one.key]) for one in likely])

    def _ranked(self, listed: list[Candidate]) -> list[Candidate]:
        """Return the candidates that may be believed, the one that gains most first.

        Where one that would leave no car gains more by far, what is named in its place is in doubt.
        """
        believed = [one for one in listed if self._believed(one.suspect, one.fit, one.gain)]
        least = max([CHANCE, *(one.gain for one in believed)]) + ALIKE
        self.in_doubt |= any(
            one.gain > least
            and not one.suspect.leaves_a_car(self.size(one.suspect, one.fit.sizes), self.vehicle)
            for one in listed
        )
        return sorted(believed, key=lambda one: -one.gain)

    def _candidate(self, suspect: Suspect, start: Sizes) -> Candidate:
        keys = self.keys(suspect)
        fit = self.fitter.fit([*self.chosen, *keys], start)
        price = 0.5 * (len(keys) - 1) + suspect.price
        return Candidate(suspect, fit, self.fit.J - fit.J - price)

    def _believed(self, suspect: Suspect, fit: Fit, gain: float = 0.0) -> bool:
        """Return whether a size stands out, by its deviation or by what it gains of J.

        Both say the same where sizes change all in proportion; beside one that is bounded, as the
        roll of the body, a size may be uncertain and yet surely not zero.
        """
        size = self.size(suspect, fit.sizes)
        most = BELIEVED * suspect.plausible * suspect.scale(self.vehicle)
        by_gain = math.inf
        if gain > 0.0:
            by_gain = math.hypot(size / math.sqrt(2.0 * gain), self.least(suspect))
        telling = abs(size) > TELLING * min(self.deviation(suspect, fit), by_gain)
        possible = (suspect.signed or size > 0.0) and suspect.leaves_a_car(size, self.vehicle)
        return abs(size) < most and telling and possible

    def run(self) -> None:
        """Take in one fault after the other."""
        while len(self.found) < MOST:
            if len(self.found) >= GIVEN_UP_WITH and max(self.fit.misses) > GIVEN_UP_FROM:
                break
            listed = self._trusted(self.candidates())
            if not listed or listed[0].gain < CHANCE:
                break
            best, *rest = listed
            alike = tuple(one for one in rest if one.gain > max(best.gain - ALIKE, 0.5 * best.gain))
            self.found.append(Found(best.suspect, best.gain, alike))
            self.fit = self.fitter.fit(self.chosen, best.fit.sizes)
            self._drop()

    def _trusted(self, listed: list[Candidate]) -> list[Candidate]:
        """Return the candidates again, each equation trusted as far as the best explains it."""
        if not listed or listed[0].gain < CHANCE:
            return []
        self.fitter.distrust(listed[0].fit.misses)
        self.fit = self.fitter.fit(self.chosen, self.fit.sizes)
        again = [
            self._candidate(one.suspect, one.fit.sizes) for one in listed if one.gain > 0.5 * CHANCE
        ]
        return self._ranked(again)

    def _drop(self) -> None:
        """Drop what the later ones explain too."""
        for one in self.found[:-1]:
            keys = self.keys(one.suspect)
            others = [key for key in self.chosen if key not in keys]
            fit = self.fitter.fit(others, self.fit.sizes)
            if fit.J - self.fit.J < CHANCE:
                self.found.remove(one)
                self.fit = fit

    def findings(self) -> tuple[Finding, ...]:
        """Return what was found: what explains most first, followed by what may be it instead."""
        listed: list[tuple[Suspect, Finding]] = []
        clear: list[Suspect] = []
        taken = {one.suspect.key for one in self.found}
        for one in self.found:
            alike = [other for other in one.alike if other.suspect.key not in taken]
            taken |= {other.suspect.key for other in alike}
            gains = [CHANCE, one.gain, *(other.gain for other in alike)]
            odds = np.exp((np.array(gains) - one.gain) / TEMPER)
            shares = odds / odds.sum()
            group = float(1.0 - shares[0])
            names = [other.suspect for other in alike]
            deviation = self.real_deviation(one.suspect, self.fit)
            real = _beyond(self.size(one.suspect, self.fit.sizes), deviation)
            told = real * float(shares[1]), real * group
            first = self._finding(one.suspect, self.fit.sizes, deviation, told, names)
            listed.append((one.suspect, first))
            # Numbers of the car can be measured; a drive is no reason to overrule who did.
            changed = first.repair.vehicle if first.repair is not None else {}
            measured = not {*changed} <= {*self.vehicle.estimated}
            believed = self._believed(one.suspect, self.fit)  # together with the others too
            believed = believed and abs(self.size(one.suspect, self.fit.sizes)) > STANDS * deviation
            # Late or behind a low pass, the same channel comes back by either repair.
            twins = all(other.is_late_as(one.suspect) for other in names)
            if believed and twins and not measured and first.group > SURE:
                clear.append(one.suspect)
            for other, share in zip(alike, shares[2:].tolist(), strict=True):
                off = self.real_deviation(other.suspect, other.fit)
                told = real * share, real * group
                second = self._finding(other.suspect, other.fit.sizes, off, told, [one.suspect])
                listed.append((other.suspect, second))
        doubtful = self.in_doubt or len(self.found) > SEVERAL
        stands = set() if doubtful else self._standing(clear)
        return tuple(
            replace(one, sure=one.repair is not None and suspect.key in stands)
            for suspect, one in listed
        )

    def _standing(self, clear: list[Suspect]) -> set[str]:
        """Return the keys of those whose sizes stay where all that is in doubt is left out.

        Only what is sure is taken out of a log, so it must hold without the rest.
        """
        keys = [key for suspect in clear for key in self.keys(suspect)]
        if set(keys) == set(self.chosen):
            return {suspect.key for suspect in clear}
        alone = self.fitter.fit(keys, self.fit.sizes)
        moved = {
            one.key: abs(self.size(one, alone.sizes) - self.size(one, self.fit.sizes))
            for one in clear
        }
        return {one.key for one in clear if moved[one.key] < STAYS * self.deviation(one, self.fit)}

    def _repair(self, suspect: Suspect, sizes: Sizes) -> Repair | None:
        """Return what takes a suspect out: of downforce, which has two sizes, the areas of the car.

        None for what no repair does, also for areas that no car has.
        """
        if suspect.code != "downforce":
            return suspect.repair(self.size(suspect, sizes), self.vehicle)
        pairs = zip(self.vehicle.downforce, DOWNFORCE, strict=True)
        more = [told + sizes[key] for told, key in pairs]
        repair = Repair(vehicle=self.vehicle.downforce_areas(more))
        try:
            repair.on(self.vehicle)
        except VehicleError:
            return None
        return repair

    def _areas_told(self, repair: Repair | None) -> str:
        """Return what a vehicle file is to say of downforce, "" where it says all."""
        told = {} if repair is None else repair.vehicle
        lines = [f"{name} = {told[name]:.2g}" for name in AREAS if name in told]
        return f"; in the vehicle file, m²: {', '.join(lines)}" if lines else ""

    def _finding(
        self,
        suspect: Suspect,
        sizes: Sizes,
        deviation: float,
        told: tuple[float, float],
        alike: list[Suspect],
    ) -> Finding:
        """Return a suspect as a finding, told with its confidence and that of its group."""
        size = self.size(suspect, sizes)
        text = suspect.words(size, deviation, self.vehicle)
        if alike:
            others = ", ".join(f"{one.code} {one.channel}".strip() for one in alike)
            text += f"; this drive cannot tell it from: {others}"
        factor = suspect.is_factor
        repair = self._repair(suspect, sizes)
        return Finding(
            code=suspect.code,
            channel=suspect.channel,
            size=math.exp(size) if factor else size,
            deviation=math.exp(size) * deviation if factor else deviation,
            unit=suspect.unit,
            confidence=told[0],
            group=told[1],
            text=text + self._areas_told(repair),
            repair=repair,
        )


def _beyond(size: float, deviation: float) -> float:
    """Return how probably a size is more than its deviation: 0 of one that is nothing beside it."""
    return math.erf(abs(size) / (math.sqrt(2.0) * deviation))


class Examination(NamedTuple):
    """What was found in a log.

    findings : what explains most first.   unseen : what the log cannot tell, a line each.
    sizes : of what was taken in, by key, as they were estimated together.
    """

    findings: tuple[Finding, ...]
    unseen: tuple[str, ...]
    sizes: Sizes


def examine(recording: Recording, vehicle: Vehicle) -> Examination:
    """Return the faults of a log and of what is told of its car, and what this drive cannot tell.

    Parameters
    ----------
    recording : as it was logged; of a long one lively stretches are looked at.
    vehicle : as it was told; its cornering stiffnesses are not looked at.
    """
    stretches = stretches_of(recording, vehicle, longest=LONGEST, pieces=PIECES)
    balance = Balance(stretches, vehicle)
    if len(balance) < FEWEST:
        unseen = "sizes of faults: the car hardly drives, or not fast enough"
        return Examination((), (unseen,), {})
    search = Search(balance)
    search.run()
    sizes = {key: search.fit.sizes[key] for key in search.chosen}
    worst = int(np.argmax(search.fit.misses))
    if search.fit.misses[worst] > BEYOND:
        return Examination((), (f"sizes of faults: {UNEXPLAINED[worst]}",), sizes)
    return Examination(search.findings(), search.unseen(), sizes)


def estimate(recording: Recording, vehicle: Vehicle) -> tuple[Finding, ...]:
    """Return the faults of a log and of what is told of its car, what explains most first.

    Parameters
    ----------
    recording : as it was logged; of a long one lively stretches are looked at.
    vehicle : as it was told; its cornering stiffnesses are not looked at.
    """
    return examine(recording, vehicle).findings
