"""Retrieved images as data of CIL, the Core Imaging Library, without a file between.

    from beamlet import cil
    data = cil.read("run", "refraction")    # an AcquisitionData

It needs CIL, which conda installs (``conda install -c conda-forge -c ccpi cil``).
"""

from __future__ import annotations

from typing import Any

from ._images import Images
from ._scene import Path
from .convert import CilScan, Contrast, _data


def read(source: Images | Path, contrast: Contrast = "transmission", *, fill: bool = True) -> Any:
    """A contrast as ``cil.framework.AcquisitionData``. Transmissions are T: CIL's
    ``TransmissionAbsorptionConverter`` takes -ln of them.

    Args:
        source: Retrieved images, or a run directory or folder that has them.
        contrast: The contrast.
        fill: Pixels without a usable value are filled; ``False``: every pixel is as retrieved.

    Raises:
        ArgumentError: Views that move the sample, columns at uneven places, no such contrast, or a view without any
            value to fill from.
        FileError: No images are there.
        ImportError: CIL is not installed.
    """
    from cil.framework import AcquisitionData, AcquisitionGeometry

    images = source if isinstance(source, Images) else Images.open(source)
    scan = CilScan.of(images)
    data, _ = _data(images, contrast, fill)
    create = AcquisitionGeometry.create_Cone3D
    if len(scan.source) == 2:
        create, data = AcquisitionGeometry.create_Cone2D, data[:, 0]
    geometry = create(source_position=scan.source.tolist(), detector_position=scan.detector.tolist())
    geometry.set_angles(scan.angles, angle_unit="degree")
    across, rows = scan.pixels
    panel = (across, rows) if len(scan.source) == 3 else across
    geometry.set_panel(panel, pixel_size=scan.pitch, origin=scan.origin)
    geometry.set_labels(scan.labels)
    return AcquisitionData(data, deep_copy=False, geometry=geometry)
