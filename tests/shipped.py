"""The shipped C beside its CasADi function: a step, a reset, what is learnt."""

import ctypes
import json
import math
from enum import IntEnum

import numpy as np

from identifier.export.compiled import CompiledPackage


class Status(IntEnum):
    """What a step did with its sample; see the README of the package."""

    OK = 0
    REST = 1
    IMPLAUSIBLE = 2
    BAD_INPUT = 3
    BAD_RESULT = 4
    BAD_CALL = 5
    STALE = 6


class Shipped(CompiledPackage):
    """One instance of the shipped C, with every door that the C has."""

    def __init__(self, manifest, read, *, single=None):
        super().__init__(manifest, read, single=single)
        learnt = [one for one in manifest["carried"] if one["learnt"]]
        self._weights = {one["name"]: tuple(one["shape"]) for one in learnt}

    @classmethod
    def of(cls, package, *, single=None):
        """An instance of a package that was just built."""
        manifest = json.loads(package.files[f"{package.specialized.name}.json"])
        return cls(manifest, package.files.__getitem__, single=single)

    def init(self):
        self._call("instance_init")(self._instance)

    def reset(self):
        self._call("instance_reset")(self._instance)

    @property
    def version(self):
        self._call("version").restype = ctypes.c_char_p
        return self._call("version")().decode()

    @property
    def faults(self):
        return self._call("instance_faults")(self._instance)

    @property
    def state(self):
        """As it lies in memory, with the parameters after it."""
        return self._instance.raw

    def step(self, v_x, v_y, r, delta_f, delta_r=0.0, a_y=math.nan):
        sample = [v_x, v_y, r, delta_f, delta_r, a_y]
        run = self.run_samples(np.array([sample[: len(self.inputs)]]))
        return run.status[0], run.axle_force[0]

    @property
    def weights(self):
        """What is learnt, by name; empty for a method that estimates a signal."""
        sizes = [math.prod(shape) for shape in self._weights.values()]
        flat = np.empty(sum(sizes))
        if sizes:
            self._call("instance_weights")(self._instance, ctypes.c_void_p(flat.ctypes.data))
        parts = np.split(flat, np.cumsum(sizes)[:-1])
        named = zip(self._weights.items(), parts, strict=False)
        return {name: part.reshape(shape) for (name, shape), part in named}

    def takes(self, weights):
        """Whether it goes on with other weights, or refuses them."""
        flat = np.concatenate([np.ravel(weights[name]) for name in self._weights])
        answer = self._call("instance_take")(self._instance, ctypes.c_void_p(flat.ctypes.data))
        return answer == Status.OK

    def set_adaptation(self, adapts):
        self._call("instance_adapt")(self._instance, int(adapts))
