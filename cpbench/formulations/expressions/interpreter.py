"""A map as a function of NumPy vectors: by batches where they pay, else by the compiled interpreter."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cpbench.formulations.expressions.batches import Batches
from cpbench.formulations.expressions.map import Map
from cpbench.foundation import kernel_cache
from cpbench.foundation.matrices import Vector, freeze

_MODULE = "cpbench.formulations.expressions.kernels.interpreter"


def evaluator(F: Map) -> Callable[[Vector], Vector]:
    """Return z ↦ F(z), by the faster of the two ways."""
    batches = Batches(F)
    return batches if batches.worthwhile else Interpreted(F)


def load() -> Any:
    """Load the compiled loop: a worker has it before anything is timed."""
    return kernel_cache.compiled(kernel_cache.load(_MODULE).run)


class Interpreted:
    """z ↦ F(z), one operation after the other in machine code."""

    def __init__(self, F: Map) -> None:
        self._run = load()
        self._operations = freeze(np.column_stack([F.heads, F.left, F.right]))
        self._constants, self._outputs, self._inputs = F.constants, F.outputs, F.inputs
        self._size = max(1, F.inputs + F.constants.size + F.operations)

    def __call__(self, z: Vector) -> Vector:
        held = np.ascontiguousarray(z, dtype=float)
        if held.shape != (self._inputs,):
            raise ValueError(f"the map has {self._inputs} unknowns, the vector has shape {held.shape}")
        result = np.empty(self._outputs.size)
        # work of its own for every call: two threads may ask the same map
        self._run(self._operations, held, self._constants, self._outputs, np.empty(self._size), result)
        return result
