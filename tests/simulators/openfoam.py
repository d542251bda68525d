"""OpenFOAM, of Debian's package openfoam: a cloud of parcels in a box of gas at rest, without forces."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from simulators.shots import DENSITY, RADIUS, Rebounds, Shots

_SOLVER = "icoUncoupledKinematicParcelFoam"
_STEP, _START = 1e-3, 0.05  # s; m above the wall
_FILES = {
    "system/blockMeshDict": """scale 1;
vertices ((-50 -50 0) (50 -50 0) (50 50 0) (-50 50 0) (-50 -50 1) (50 -50 1) (50 50 1) (-50 50 1));
blocks (hex (0 1 2 3 4 5 6 7) (1 1 1) simpleGrading (1 1 1));
edges ();
boundary
(
    wall { type wall; faces ((0 3 2 1)); }
    rest { type wall; faces ((4 5 6 7) (0 1 5 4) (1 2 6 5) (2 3 7 6) (3 0 4 7)); }
);
mergePatchPairs ();""",
    "system/controlDict": """startFrom startTime; startTime 0; stopAt endTime; endTime 0.15; deltaT 1e-3;
writeControl timeStep; writeInterval 150; writeFormat ascii; writePrecision 12; timePrecision 6;""",
    "system/fvSchemes": """ddtSchemes { default Euler; } gradSchemes { default Gauss linear; }
divSchemes { default none; } laplacianSchemes { default none; }
interpolationSchemes { default linear; } snGradSchemes { default none; }""",
    "system/fvSolution": "solvers {}",
    "constant/transportProperties": "transportModel Newtonian; nu 1e-05; rhoInf 1.2;",
    "constant/turbulenceProperties": "simulationType laminar;",
    "constant/g": "dimensions [0 1 -2 0 0 0 0]; value (0 0 0);",
    "0/U": """dimensions [0 1 -1 0 0 0 0]; internalField uniform (0 0 0);
boundaryField { ".*" { type fixedValue; value uniform (0 0 0); } }""",
}
_CLOUD = """solution
{{
    active true; coupled false; transient yes; cellValueSourceCorrection off; maxCo 0.3;
    interpolationSchemes {{ rho cell; U cell; mu cell; }}
    integrationSchemes {{ U Euler; }}
}}
constantProperties {{ rho0 {density}; }}
subModels
{{
    particleForces {{}}
    injectionModels
    {{
        table
        {{
            type kinematicLookupTableInjection; inputFile "parcels"; parcelBasisType fixed; nParticle 1;
            massTotal 1; SOI 0; duration {short}; parcelsPerSecond {rate}; randomise false;
        }}
    }}
    dispersionModel none;
{lines}
    heatTransferModel none; surfaceFilmModel none; stochasticCollisionModel none; collisionModel none;
    radiation off;
}}
cloudFunctions {{}}"""
_CLASSES = {
    "constant/g": "uniformDimensionedVectorField",
    "0/U": "volVectorField",
    "constant/parcels": "GlobalIOList<kinematicParcelInjectionData>",
}


def version() -> str:
    """What runs here; empty without it."""
    if shutil.which(_SOLVER) is None:
        return ""
    said = subprocess.run([_SOLVER, "-help"], capture_output=True, text=True, check=False, env=_environment())
    found = re.search(r"OpenFOAM-[ v(]*(\w+)", said.stdout)
    return found.group(1) if found else "of an unknown version"


def _environment() -> dict[str, str]:
    # Debian's package keeps its etc there, and sets no variable
    return {"WM_PROJECT_DIR": "/usr/share/openfoam"} | dict(os.environ)


def shoot(lines: Sequence[str], shots: Shots) -> Rebounds:
    """All at once, with the exported lines as they are; parcels have no spin, and so must the shots."""
    if np.any(shots.omega != 0.0):
        raise RuntimeError("OpenFOAM's parcels have no spin.")
    n = shots.angle.size
    # all of them hit the wall and none comes back to another one within the run
    scale = 1.0 / shots.approach
    rows = "\n".join(
        f"(0 {0.1 * i - 40.0:.6g} {_START}) ({x:.15g} 0 -1) {2.0 * RADIUS} {DENSITY} 1"
        for i, x in enumerate(shots.along * scale)
    )
    cloud = _CLOUD.format(density=DENSITY, lines="\n".join(lines), short=0.5 * _STEP, rate=1.001 / _STEP)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in {
            **_FILES, "constant/kinematicCloudProperties": cloud, "constant/parcels": f"(\n{rows}\n)"
        }.items():  # fmt: skip
            path = Path(folder, name)
            path.parent.mkdir(exist_ok=True)
            head = f"version 2.0; format ascii; class {_CLASSES.get(name, 'dictionary')}; object {path.name};"
            path.write_text(f"FoamFile {{ {head} }}\n{text}\n", encoding="utf-8")
        for program in ("blockMesh", _SOLVER):
            run = subprocess.run(
                [program], cwd=folder, capture_output=True, text=True, check=False, env=_environment()
            )
            if run.returncode:
                raise RuntimeError(f"{program} stopped: {run.stdout[-2000:]}{run.stderr[-2000:]}")
        found = Path(folder, "0.15", "lagrangian", "kinematicCloud")
        velocity = _numbers(found / "U").reshape(-1, 3)
        order = _numbers(found / "origId").astype(int)
    if len(order) != n or (velocity[:, 2] < 0.0).any():
        raise RuntimeError("OpenFOAM: a parcel has not left the wall.")
    velocity = velocity[order.argsort()] / scale[:, None]
    return shots.rebounds(velocity, np.zeros((n, 3)))


def _numbers(path: Path) -> np.ndarray:
    """Of the list in the file of a field: N(...), or N{value} where all are the same."""
    body = path.read_text(encoding="utf-8").split("// * * *", 1)[1]
    found = re.search(r"^(\d+)\s*([({])(.*)[)}]", body, re.MULTILINE | re.DOTALL)
    assert found is not None
    values = np.array(re.findall(r"[-+\d.][-+.\deE]*", found.group(3)), dtype=float)
    return np.tile(values, int(found.group(1))) if found.group(2) == "{" else values
