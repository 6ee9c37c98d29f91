"""What `ti.identify` returns: a run of a method over a drive, which answers all about it."""

from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from os import PathLike
from pathlib import Path

from codegen import markup
from codegen.arrays import Array
from codegen.errors import TireidError
from identifier.certificate import Certificate
from identifier.method import Method
from identifier.run import History
from identifier.tire_model import AXLES, TireModel
from identifier.verdict import Verdict, calibrated, judge
from models.recordings import Recording
from models.vehicle import Vehicle
from tireid.output import output_folder, write_json


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class Run:
    """A method's run over a recording; what takes long is computed where it is first asked for.

    Parameters
    ----------
    history : states and outputs, sample by sample.
    """

    history: History

    @property
    def recording(self) -> Recording:
        """What it ran over, with the v_y that the method estimated where there was none."""
        return self.history.recording

    @property
    def vehicle(self) -> Vehicle:
        """The car, as far as the method knew it."""
        return self.history.vehicle

    @property
    def method(self) -> Method:
        """The method that ran."""
        return self.history.method

    @property
    def force(self) -> Array:
        """Axle forces (n, 2) [N]: by the weights of each instant, or of a whole-log fit."""
        return self.history.axle_force

    @cached_property
    def tire(self) -> TireModel:
        """The tires at the end, their band calibrated on the drive.

        It is `freeze()` but for the band; that itself where the method has no band, or too little
        is driven.

        Raises
        ------
        CannotFreezeError
            Where the method estimates a signal, not a model.
        """
        return calibrated(self.history, verdict=self.verdict if self.method.whole else None)

    def freeze(self, t: float | None = None) -> TireModel:
        """Return the tires identified until a time; their band is not calibrated.

        Parameters
        ----------
        t : time in the recording's own clock [s]; None is the end.

        Raises
        ------
        CannotFreezeError
            Where the method estimates a signal, not a model.
        ValueError
            Where the recording begins after that time, or ends before it.
        """
        end = float(self.recording.t[-1])
        if isinstance(t, Real) and t > end + self.recording.dt:
            raise ValueError(f"the recording ends at {end:g} s, before {t:g} s")
        return self.history.freeze(t)

    @cached_property
    def verdict(self) -> Verdict:
        """Whether the tire is good, and what speaks against it.

        Raises
        ------
        CannotFreezeError
            Where the method estimates a signal, not a model.
        """
        return judge(self.history)

    @cached_property
    def certificate(self) -> Certificate:
        """What is proven of the method for this car."""
        return self.method.certify(self.vehicle)

    def save(self, folder: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write weights.json, as `TireModel.load` reads it, and verdict.json into a folder.

        Parameters
        ----------
        folder : to write, whole or not at all.
        overwrite : replace what an earlier run wrote there.

        Raises
        ------
        CannotFreezeError
            Where the method estimates a signal, not a model.
        FileExistsError
            Where the folder is not empty and is not to be replaced.
        OutputError
            Where it holds what no run of tireid wrote.
        OSError
            Where it cannot be written.
        """
        with output_folder(Path(folder), force=overwrite) as scratch:
            self.tire.save(scratch / "weights.json", valid=self.verdict.valid)
            write_json(scratch / "verdict.json", self.verdict.to_dict())

    def __repr__(self) -> str:
        return f"<Run of {type(self.method).__name__} over {self.recording!r}>"

    def _repr_html_(self) -> str:
        try:
            verdict = self.verdict
            looks = dict.fromkeys(AXLES, "" if verdict.valid else markup.REFUSED)
            for one in verdict.numbers:
                if one.state == "not valid":
                    looks[one.axle] = markup.STRUCK
            found = [verdict._repr_html_(), self.tire._repr_html_([*looks.values()])]
        except TireidError as error:  # it estimates a signal, or diverged
            found = [markup.line(str(error), "No tires:")]
        method = markup.line(f"over {self.recording.name}", type(self.method).__name__)
        return markup.card(method, *found, self.recording._repr_html_())
