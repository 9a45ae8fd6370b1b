"""A running unit: its library in this process, loaded by FMPy; values by name; its state."""

import shutil
import weakref
from collections.abc import Callable, Mapping, Sequence
from tempfile import mkdtemp
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.exchange.errors import ExchangeError
from ephs.solve.exchange.unit import Unit


@final
class Running:
    """One instance of a unit. It ends with its last reference.

    Attributes
    ----------
    time
        In s, where it stands.
    """

    def __init__(self, name: str, unit: Unit) -> None:
        from fmpy import extract
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        self.name, self.unit, self.time = name, unit, 0.0
        self._three = unit.description.fmiVersion.startswith("3.")
        self._told: list[str] = []
        folder = mkdtemp(prefix="ephs-unit-")
        made: list[Any] = []
        self._close = weakref.finalize(self, _closed, made, folder)
        extract(str(unit.file), folder)
        self._slave: Any = (FMU3Slave if self._three else FMU2Slave)(
            guid=unit.description.guid, unzipDirectory=folder, instanceName=name,
            modelIdentifier=unit.description.coSimulation.modelIdentifier,
        )  # fmt: skip
        self._called(self._instantiate)
        made.append(self._slave)

    def _instantiate(self) -> None:
        told = self._told  # a reference to the unit would keep it alive

        def logged(*given: Any) -> None:  # the message is the last of four by FMI 3, of five by FMI 2
            told.append((given[-1] or b"").decode("utf-8", "replace"))

        if self._three:
            from fmpy.fmi3 import fmi3LogMessageCallback

            self._slave.instantiate(logMessage=fmi3LogMessageCallback(logged))
        else:
            from fmpy import calloc, free
            from fmpy.fmi2 import (
                fmi2CallbackAllocateMemoryTYPE,
                fmi2CallbackFreeMemoryTYPE,
                fmi2CallbackFunctions,
                fmi2CallbackLoggerTYPE,
            )

            callbacks = fmi2CallbackFunctions()
            callbacks.logger = fmi2CallbackLoggerTYPE(logged)
            callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
            callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
            self._slave.instantiate(callbacks=callbacks)

    def begin(self, t: float) -> None:
        """Enter initialization at a time in s, with the values of the start."""
        self.time = t
        self.set(self.unit.start)
        if self._three:
            self._called(self._slave.enterInitializationMode, startTime=t)
        else:
            self._called(self._slave.setupExperiment, startTime=t)
            self._called(self._slave.enterInitializationMode)

    def ready(self) -> None:
        """Leave initialization."""
        self._called(self._slave.exitInitializationMode)

    def set(self, values: Mapping[str, float]) -> None:
        """Set real variables by name."""
        if values:
            references = [self.unit.variables[name].reference for name in values]
            write = self._slave.setFloat64 if self._three else self._slave.setReal
            self._called(write, references, list(values.values()))

    def get(self, names: Sequence[str]) -> list[float]:
        """Read real variables by name.

        Raises
        ------
        ExchangeError
            One is not finite.
        """
        read = self._slave.getFloat64 if self._three else self._slave.getReal
        found = [float(value) for value in self._called(read, [self.unit.variables[name].reference for name in names])]
        for name, value in zip(names, found, strict=True):
            if not np.isfinite(value):
                raise ExchangeError("call", where=self.name, time=self.time, found=f"{name} is {value}")
        return found

    def step(self, t: float) -> None:
        """Go on to a time in s.

        Raises
        ------
        ExchangeError
            The unit refuses, or stops before.
        """
        result = self._called(self._slave.doStep, self.time, t - self.time)
        if self._three:
            _, ended, early, last = result
            if ended or early:
                what = "it ends the simulation" if ended else f"it stops at {last!r} s"
                raise ExchangeError("call", where=self.name, time=self.time, found=what)
        self.time = t

    def snapshot(self) -> Array:
        """(n,) bytes of its state, as numbers."""
        state = self._called(self._slave.getFMUState)
        try:
            return np.frombuffer(self._called(self._slave.serializeFMUState, state), np.uint8).astype(float)
        finally:
            self._slave.freeFMUState(state)

    def restore(self, t: float, kept: Array) -> None:
        """Go on at a time in s from a state."""
        state = self._called(self._slave.deserializeFMUState, kept.astype(np.uint8).tobytes())
        try:
            self._called(self._slave.setFMUState, state)
        finally:
            self._slave.freeFMUState(state)
        self.time = t

    def _called(self, function: Callable[..., Any], *given: Any, **named: Any) -> Any:
        self._told.clear()
        try:
            return function(*given, **named)
        except Exception as error:
            said = "; ".join([str(error), *self._told])
            raise ExchangeError("call", where=self.name, time=self.time, found=said) from error


def _closed(made: list[Any], folder: str) -> None:
    for slave in made:
        slave.freeInstance()
    shutil.rmtree(folder, ignore_errors=True)
