"""A falling sheet by Exudyn's thin plates in absolute nodal coordinates, where Exudyn is installed."""

import time
from importlib import import_module
from typing import Any

import numpy as np


def falling(sheet: Any, elements: tuple[int, int], steps: int) -> tuple[np.ndarray, dict[str, Any]]:
    """Places (21, 3) of the free corner at even times, with steps and seconds of processor time.

    Parameters
    ----------
    sheet
        Length, width, thickness, E, nu, rho, gravity and until, in SI units.
    elements
        Along the length and the width.
    steps
        Of generalised α.
    """
    exu: Any = import_module("exudyn")
    items: Any = import_module("exudyn.itemInterface")
    mbs: Any = exu.SystemContainer().AddSystem()
    n, m = elements
    slopes = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    nodes = [
        [
            mbs.AddNode(
                items.NodePointSlope12(referenceCoordinates=[sheet.length * i / n, sheet.width * j / m, 0.0, *slopes])
            )
            for j in range(m + 1)
        ]
        for i in range(n + 1)
    ]
    nu = sheet.nu
    plane = np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 0.5 * (1.0 - nu)]])
    stretch = sheet.E * sheet.thickness / (1.0 - nu * nu) * plane
    for i in range(n):
        for j in range(m):
            corners = [nodes[i][j], nodes[i + 1][j], nodes[i + 1][j + 1], nodes[i][j + 1]]
            plate = items.ObjectANCFThinPlate(
                thickness=sheet.thickness, density=sheet.rho, strainCoefficients=stretch,
                curvatureCoefficients=sheet.thickness**2 / 12.0 * stretch, nodeNumbers=corners,
            )  # fmt: skip
            mass = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=mbs.AddObject(plate)))
            mbs.AddLoad(items.LoadMassProportional(markerNumber=mass, loadVector=[0.0, 0.0, -sheet.gravity]))
    ground = mbs.AddNode(items.NodePointGround(referenceCoordinates=[0.0, 0.0, 0.0]))
    still = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
    for node in nodes[0]:
        for coordinate in range(9):
            held = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))
            mbs.AddObject(items.ObjectConnectorCoordinate(markerNumbers=[still, held]))
    seen = mbs.AddSensor(
        items.SensorNode(
            nodeNumber=nodes[n][m], storeInternal=True, writeToFile=False,
            outputVariableType=exu.OutputVariableType.Position,
        )
    )  # fmt: skip
    mbs.Assemble()
    options = exu.SimulationSettings()
    options.timeIntegration.numberOfSteps, options.timeIntegration.endTime = steps, sheet.until
    options.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    options.timeIntegration.newton.useModifiedNewton = True
    options.timeIntegration.verboseMode = 0
    options.solution.file.write = False
    options.solution.sensors.writePeriod = sheet.until / 20.0
    options.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    start = time.process_time()
    if not mbs.SolveDynamic(options):
        raise RuntimeError("Exudyn does not solve the falling sheet")
    return mbs.GetSensorStoredData(seen)[:, 1:], {"steps": steps, "seconds": time.process_time() - start}
