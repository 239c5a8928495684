"""Edge-illumination X-ray phase contrast imaging, simulated from CAD models.

Lengths are metres, angles radians, energies keV unless a name says otherwise; frame and signs are
those of docs/physics.md. See docs/python.md.
"""

from ._beamlet import __version__
from ._engine import (
    CheckReport,
    Device,
    Engine,
    check,
    default_engine,
    devices,
    simulate_many,
)
from ._errors import (
    ArgumentError,
    DeviceError,
    Error,
    FileError,
    InterruptedWork,
    MeshError,
    OutOfMemoryError,
    SceneError,
    TallyError,
)
from ._images import Images
from ._projector import Projector
from ._retrieve import retrieve
from ._run import Axis, Counts, Run
from ._scene import Object, Scene
from ._sweep import Sweep, sweep
from ._tools import Beam, Difference, Material, Spectrum, compare, material, spectrum
from ._view import Picture, view
from ._volume import Truth, Volume, reconstruct

__all__ = [
    "ArgumentError",
    "Axis",
    "Beam",
    "CheckReport",
    "Counts",
    "Device",
    "DeviceError",
    "Difference",
    "Engine",
    "Error",
    "FileError",
    "Images",
    "InterruptedWork",
    "Material",
    "MeshError",
    "Object",
    "OutOfMemoryError",
    "Picture",
    "Projector",
    "Run",
    "Scene",
    "SceneError",
    "Spectrum",
    "Sweep",
    "TallyError",
    "Truth",
    "Volume",
    "__version__",
    "check",
    "compare",
    "default_engine",
    "devices",
    "material",
    "reconstruct",
    "retrieve",
    "simulate_many",
    "spectrum",
    "sweep",
    "view",
]
