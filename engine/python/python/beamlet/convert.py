"""Retrieved images for other tools: HDF5 files by h5py, and arrays for ASTRA.

    python -m beamlet.convert RUN --to astra|nxtomo|cil|dxchange -o FILE

One contrast a file, but for DXchange. Pixels without a result, transmissions of 0 or less, and misfits of the
transmission are filled as by `beamlet reconstruct`; the attribute filled_pixels of the data is their
number. Datasets are contiguous and unfiltered; lengths are m in NXtomo, mm in CIL. NXtomo and CIL take
scans on a circle with even columns.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _beamlet
from ._arguments import path as place
from ._arguments import shown
from ._errors import Error, FileError, wrong
from ._images import SOURCES, Images
from ._scene import Path

if TYPE_CHECKING:
    import h5py

Contrast = Literal["transmission", "refraction", "dark_field"]

#: What the contrasts are, for people who open the files.
ABOUT = {
    "transmission": "transmission T, 1 without sample",
    "refraction": "refraction angle alpha, positive towards +x",
    "dark_field": "variance of the refraction angle, sigma_DF^2",
}


def _views(images: Images) -> dict[str, Any]:
    """Geometry of the views."""
    if not isinstance(images, Images):
        raise wrong("images", type(images).__name__, "Images, as of Run.retrieve or Images.open")
    if images.geometry is None:
        raise wrong("geometry", "views without angles", "a scene with an angle for each view")
    return images.geometry


def _circle(images: Images) -> dict[str, Any]:
    """Geometry of a scan on a circle with even columns."""
    geometry = _views(images)
    if geometry["axis_column"] is None:
        raise wrong("scan", "views that move the sample", "views on a circle")
    if geometry["astra_cone_vec_mm"] is None:
        raise wrong("columns", "columns at uneven places", "even columns")
    return geometry


def _data(
    images: Images, contrast: str, fill: bool
) -> tuple[NDArray[np.float32], dict[str, Any]]:
    """A contrast ``[view][row][column]``, and what its dataset says of filled pixels."""
    has = [name for name in ABOUT if name in images]
    if contrast not in has:
        raise wrong("contrast", shown(contrast), ", ".join(has))
    data = np.ascontiguousarray(images[contrast], dtype=np.float32)
    if not fill:
        return data, {}
    assert images.geometry is not None
    places = [images.geometry["columns_m"], images.geometry["rows_m"]]
    quantity = next(name for name, source in SOURCES.items() if source == contrast)
    data, filled = _beamlet.fill(places, quantity, data, images.get("flags"))
    return data, {"filled_pixels": filled}


def _pitch(places: list[float], other: list[float]) -> float:
    """Distance of places; of the others, where there is one place."""
    if len(places) < 2:
        places = other
    return abs(places[-1] - places[0]) / max(len(places) - 1, 1)


def _written(path: Path, write: Callable[[h5py.File], None]) -> None:
    """Writes a file whole or not at all; one that is there is not replaced."""
    import h5py

    path = place("path", path)
    part = FilePath(f"{path}.part")
    try:
        with h5py.File(part, "x") as file:
            write(file)
        os.link(part, path)
    except OSError as error:
        message = f"{path}: cannot be written: {error.strerror or error}"
        raise FileError(message, file=path, found=str(error)) from error
    finally:
        part.unlink(missing_ok=True)


def _group(file: h5py.File, path: str, kind: str) -> Any:
    group = file.require_group(path)
    group.attrs["NX_class"] = kind
    return group


def _value(group: Any, name: str, value: Any, units: str | None = None) -> Any:
    group[name] = value
    if units is not None:
        group[name].attrs["units"] = units
    return group[name]


def to_nxtomo(
    images: Images, path: Path, contrast: Contrast = "transmission", *, fill: bool = True
) -> None:
    """Writes a contrast as NXtomo: for the transmission a dark frame of 0 and a flat frame of 1 come
    first, by ``image_key``; the others have projections alone.

    Args:
        images: Retrieved images.
        path: The file.
        contrast: The contrast.
        fill: Pixels without a usable value are filled; ``False``: every pixel is as retrieved.

    Raises:
        ArgumentError: No scan on a circle, no such contrast, or a view without any value to fill from.
        FileError: The file exists, or it cannot be written.
    """
    geometry = _circle(images)
    data, about = _data(images, contrast, fill)
    angles = np.array(geometry["angles_deg"])
    keys = np.zeros(len(data), dtype=np.int64)
    if contrast == "transmission":
        frame = np.zeros((1, *data.shape[1:]), dtype=np.float32)
        data = np.concatenate([frame, frame + 1, data])
        keys = np.concatenate([[2, 1], keys])
        angles = np.concatenate([angles[:1], angles[:1], angles])
    across = _pitch(geometry["columns_m"], geometry["columns_m"])
    down = _pitch(geometry["rows_m"], geometry["columns_m"])
    near, far = geometry["source_to_axis_m"], geometry["source_to_detector_m"]

    def write(file: h5py.File) -> None:
        file.attrs["default"] = "entry0000"
        entry = _group(file, "entry0000", "NXentry")
        entry.attrs["version"] = 2.1
        entry.attrs["default"] = "data"
        _value(entry, "definition", "NXtomo")
        _value(entry, "title", f"beamlet: {ABOUT[contrast]}")
        instrument = _group(file, "entry0000/instrument", "NXinstrument")
        _value(instrument, "name", "beamlet")
        source = _group(file, "entry0000/instrument/source", "NXsource")
        _value(source, "distance", -near, "m")
        _value(source, "probe", "x-ray")
        beam = _group(file, "entry0000/instrument/beam", "NXbeam")
        if images.energy is not None:
            _value(beam, "incident_energy", images.energy, "keV")
        detector = _group(file, "entry0000/instrument/detector", "NXdetector")
        _value(detector, "data", data).attrs["interpretation"] = "image"
        detector["data"].attrs["units"] = images.units[contrast]
        detector["data"].attrs.update(about)
        _value(detector, "image_key", keys)
        _value(detector, "image_key_control", keys)
        _value(detector, "x_pixel_size", across, "m")
        _value(detector, "y_pixel_size", down, "m")
        _value(detector, "distance", far - near, "m")
        middle = (len(geometry["columns_m"]) - 1) / 2
        _value(detector, "x_rotation_axis_pixel_position", geometry["axis_column"] - middle)
        _value(detector, "field_of_view", "Full")
        sample = _group(file, "entry0000/sample", "NXsample")
        _value(sample, "name", images.title or "sample")
        _value(sample, "rotation_angle", angles, "degree")
        _value(sample, "x_pixel_size", across * near / far, "m")
        _value(sample, "y_pixel_size", down * near / far, "m")
        _value(sample, "propagation_distance", near * (far - near) / far, "m")
        plot = _group(file, "entry0000/data", "NXdata")
        plot.attrs["signal"] = "data"
        plot["data"] = detector["data"]
        plot["image_key"] = detector["image_key"]
        plot["rotation_angle"] = sample["rotation_angle"]

    _written(path, write)


@dataclass(frozen=True)
class CilScan:
    """Geometry of a scan as CIL has it: mm, source and detector along y, rows from the top; the angles (degrees) are
    minus the angles of the views, since CIL turns source and detector by minus its angles. Vectors have two components
    for a single row, which is a fan."""

    labels: list[str]
    pixels: tuple[int, int]
    pitch: tuple[float, float]
    source: NDArray[np.float32]
    detector: NDArray[np.float32]
    angles: NDArray[np.float32]
    origin: str = "top-left"

    @classmethod
    def of(cls, images: Images) -> CilScan:
        """Raises `ArgumentError` for views that move the sample, and for columns at uneven places."""
        geometry = _circle(images)
        places = 1e3 * np.array(geometry["columns_m"])
        near, far = 1e3 * geometry["source_to_axis_m"], 1e3 * geometry["source_to_detector_m"]
        rows = len(geometry["rows_m"])
        across = (places[-1] - places[0]) / (len(places) - 1)
        down = 1e3 * _pitch(geometry["rows_m"], geometry["columns_m"])

        def vector(x: float, y: float) -> NDArray[np.float32]:
            return np.array([x, y] if rows == 1 else [x, y, 0], dtype=np.float32)

        return cls(
            labels=["angle", "horizontal"] if rows == 1 else ["angle", "vertical", "horizontal"],
            pixels=(len(places), rows),
            pitch=(across, down),
            source=vector(0, -near),
            detector=vector((places[0] + places[-1]) / 2, far - near),
            angles=-np.array(geometry["angles_deg"], dtype=np.float32),
        )


def to_cil(
    images: Images, path: Path, contrast: Contrast = "transmission", *, fill: bool = True
) -> None:
    """Writes a contrast in the layout of CIL's NEXUSDataWriter, for its NEXUSDataReader, with the geometry of
    :class:`CilScan`. :func:`beamlet.cil.read` does without a file.

    Args:
        images: Retrieved images.
        path: The file.
        contrast: The contrast.
        fill: Pixels without a usable value are filled; ``False``: every pixel is as retrieved.

    Raises:
        ArgumentError: Views that move the sample (CIL's writer has no such geometry), no such contrast,
            or a view without any value to fill from.
        FileError: The file exists, or it cannot be written.
    """
    scan = CilScan.of(images)
    data, about = _data(images, contrast, fill)
    sides = len(scan.source)

    def write(file: h5py.File) -> None:
        file.attrs["creator"] = np.bytes_("NEXUSDataWriter.py")
        file.attrs["file_name"] = os.path.abspath(path)
        file.attrs["NeXus_version"] = "4.3.0"
        file.attrs["written_by"] = "beamlet"
        _group(file, "entry1", "NXentry")
        entry = _group(file, "entry1/tomo_entry", "NXentry")
        values = _value(_group(file, "entry1/tomo_entry/data", "NXdata"), "data",
                        data[:, 0] if sides == 2 else data)
        values.attrs["data_type"] = "AcquisitionData"
        values.attrs.update(about)
        for index, name in enumerate(scan.labels):
            values.attrs[f"dim{index}"] = name
        values.attrs["geometry"] = "cone"
        values.attrs["dimension"] = f"{sides}D"
        values.attrs["num_channels"] = 1
        values.attrs["num_pixels_h"] = scan.pixels[0]
        values.attrs["pixel_size_h"] = scan.pitch[0]
        values.attrs["panel_origin"] = scan.origin
        values.attrs["description"] = ABOUT[contrast]
        values.attrs["units"] = images.units[contrast]
        config = entry.create_group("config")
        config["source/position"] = scan.source
        config["detector/position"] = scan.detector
        config["detector/direction_x"] = np.eye(sides, dtype=np.float32)[0]
        config["rotation_axis/position"] = np.zeros(sides, dtype=np.float32)
        if sides == 3:
            values.attrs["num_pixels_v"] = scan.pixels[1]
            values.attrs["pixel_size_v"] = scan.pitch[1]
            config["detector/direction_y"] = np.eye(3, dtype=np.float32)[2]
            config["rotation_axis/direction"] = np.eye(3, dtype=np.float32)[2]
        config["angles"] = scan.angles
        config["angles"].attrs["angle_unit"] = "degree"
        config["angles"].attrs["initial_angle"] = 0.0

    _written(path, write)


def to_dxchange(images: Images, path: Path, *, fill: bool = True) -> None:
    """Writes all contrasts as DXchange: the transmission under ``/exchange`` with a white frame of 1 and
    a dark frame of 0, the refraction (rad) under ``/exchange1``, the dark field (rad²) under
    ``/exchange2``; ``theta`` in degrees.

    Args:
        images: Retrieved images.
        path: The file.
        fill: Pixels without a usable value are filled; ``False``: every pixel is as retrieved.

    Raises:
        ArgumentError: Views without angles, or a view without any value to fill from.
        FileError: The file exists, or it cannot be written.
    """
    theta = np.array(_views(images)["angles_deg"])
    found = {name: _data(images, name, fill) for name in ABOUT if name in images}

    def write(file: h5py.File) -> None:
        file["implements"] = "exchange"
        groups = ("exchange", "exchange1", "exchange2")
        for group, contrast in zip(groups, ABOUT, strict=True):
            if contrast not in found:
                continue
            values, about = found[contrast]
            data = _value(file.create_group(group), "data", values)
            data.attrs.update(about)
            data.attrs["axes"] = "theta:y:x"
            data.attrs["units"] = images.units[contrast]
            data.attrs["description"] = ABOUT[contrast]
            file[f"{group}/title"] = contrast
            _value(file[group], "theta", theta, "degrees")
        frame = (1, *images.transmission.shape[1:])
        file["exchange/data_white"] = np.ones(frame, dtype=np.float32)
        file["exchange/data_dark"] = np.zeros(frame, dtype=np.float32)

    _written(path, write)


def to_astra(
    images: Images, contrast: Contrast = "transmission", *, fill: bool = True
) -> dict[str, Any]:
    """Projections and geometry as astra-toolbox takes them, lengths in mm.

    Args:
        images: Retrieved images.
        contrast: The contrast.
        fill: Pixels without a usable value are filled: ``projections`` are what
            :meth:`beamlet.Images.reconstruct` takes. ``False``: they are NaN there, and misfits of the
            transmission are as retrieved, on which iterations of ASTRA may diverge.

    Returns:
        ``projections`` (row, view, column): -ln of the transmission, refraction angles (rad) or
        variances (rad²), ``vectors`` of ``cone_vec``, and ``proj_geom``, the dict of
        ``astra.create_proj_geom("cone_vec", ...)``.

    Raises:
        ArgumentError: No scan on a circle, columns at uneven places, no such contrast, or a view without
            any value to fill from.
    """
    geometry = _circle(images)
    data, _ = _data(images, contrast, fill)
    if contrast == "transmission":
        data = -np.log(data, out=np.full_like(data, np.nan), where=data > 0)
    vectors = np.array(geometry["astra_cone_vec_mm"])
    views, rows, columns = data.shape
    proj_geom = {
        "type": "cone_vec",
        "DetectorRowCount": rows,
        "DetectorColCount": columns,
        "Vectors": vectors,
    }
    projections = np.ascontiguousarray(data.transpose(1, 0, 2))
    assert projections.shape[1] == len(vectors) == views
    return {"projections": projections, "vectors": vectors, "proj_geom": proj_geom}


def main(words: list[str] | None = None) -> int:
    """``python -m beamlet.convert``; the exit code."""
    parser = argparse.ArgumentParser(prog="python -m beamlet.convert", description=__doc__)
    parser.add_argument("run", help="run directory with retrieved images, or a folder of images")
    parser.add_argument("--to", required=True, choices=["astra", "nxtomo", "cil", "dxchange"])
    parser.add_argument("-o", "--output", required=True,
                        help="file to write, for ASTRA a directory; it must not exist yet")
    parser.add_argument("--contrast", choices=list(ABOUT), default="transmission",
                        help="contrast of an NXtomo or CIL file")
    parser.add_argument("--as-retrieved", action="store_true",
                        help="leave pixels without a result NaN, and misfits of the transmission as they are")
    arguments = parser.parse_args(words)
    if arguments.to == "astra":
        # As `beamlet convert` writes them.
        leave = ["--as-retrieved"] if arguments.as_retrieved else []
        return _beamlet.program(["convert", arguments.run, "--to", "astra", "-o", arguments.output, *leave])
    try:
        images = Images.open(arguments.run)
        fill = not arguments.as_retrieved
        if arguments.to == "nxtomo":
            to_nxtomo(images, arguments.output, arguments.contrast, fill=fill)
        elif arguments.to == "cil":
            to_cil(images, arguments.output, arguments.contrast, fill=fill)
        else:
            to_dxchange(images, arguments.output, fill=fill)
    except ImportError as error:
        print(f"error: {error}: pip install 'beamlet[convert]'", file=sys.stderr)
        return 1
    except Error as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
