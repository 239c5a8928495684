"""Reads what beamlet writes: run directories and retrieved images. Needs numpy, OpenEXR or tifffile
for runs in those formats, and h5py to write DXchange files.

    import beamlet_run
    run = beamlet_run.Run("run")
    run.flat        # [step, row, column]
    run.sample      # [view, step, row, column]

Flats of `scan.flats_every`, and darks of `scan.darks_every`, are [index, step, row, column].

Values are float32: 1.0 is what a pixel gets without masks and without sample. Row 0 is the top of
the image (largest z); columns run along +x. Detector numbers lie in run.counts_flat,
run.counts_sample and run.dark, which are None where the scene has no noise.
"""

import hashlib
import json
import os
from pathlib import Path

import numpy as np


def read_frame(path):
    """One EXR frame [row, column]."""
    import OpenEXR

    with OpenEXR.File(str(path)) as file:
        return file.channels()["Y"].pixels.copy()


def about_frame(path):
    """Geometry of an EXR frame: lengths in m, angles in rad, energy in keV."""
    import OpenEXR

    with OpenEXR.File(str(path), header_only=True) as file:
        return json.loads(file.header()["beamlet"])


def read_stack(place):
    """A stack by its path without ending, such as run/flat: from PATH.npy (mapped, not loaded), from
    PATH.tif, or from the folder PATH of EXR frames, of views of them, or of one frame per view. None where there is none."""
    place = Path(place)
    if place.with_name(place.name + ".npy").exists():
        return np.load(place.with_name(place.name + ".npy"), mmap_mode="r")
    if place.with_name(place.name + ".tif").exists():
        import tifffile

        return tifffile.imread(place.with_name(place.name + ".tif"))
    if not place.is_dir():
        return None
    views = sorted(place.glob("view_*"))
    if views:
        # A view of a stack is a folder of steps; a view of retrieved images is one frame.
        read = read_frames if views[0].is_dir() else read_frame
        return np.stack([read(view) for view in views])
    return read_frames(place)


def read_frames(folder):
    """The EXR frames of a folder, in the order of their steps."""
    return np.stack([read_frame(path) for path in sorted(Path(folder).glob("step_*.exr"))])


class Run:
    """A run directory. Arrays are read when they are first asked for."""

    NAMES = {
        "flat": "flat",
        "sample": "sample",
        "dark": "dark",
        "counts_flat": "counts/flat",
        "counts_sample": "counts/sample",
    }

    def __init__(self, path):
        self.path = Path(path)
        self.record = json.loads((self.path / "run.json").read_text())

    def __getattr__(self, name):
        if name not in self.NAMES:
            raise AttributeError(name)
        value = read_stack(self.path / self.NAMES[name])
        if value is not None:
            # Pages of a TIFF do not say where a view ends.
            sides = [self.record["extent"][side] for side in ["steps", "rows", "columns"]]
            several = "darks" if name == "dark" else "flats"
            has_views = name.endswith("sample") or self.record["extent"].get(several, 1) > 1
            value = value.reshape([-1, *sides] if has_views else [-1, *sides[1:]])
        setattr(self, name, value)
        return value

    @property
    def done(self):
        """Whether every view is there."""
        return self.record["state"] == "done"

    def check(self):
        """Names of the stacks that are not as the run committed them, by size and SHA-256."""
        changed = []
        for line in (self.path / "progress.log").read_text().splitlines():
            name, size, checksum, *_ = line.split()
            if "/rows/" in name:
                continue  # a block of a view that has a line of its own
            stack, _, view = name.rpartition("/")
            if not view.isdigit():
                stack, view = name, "0"
            values = getattr(self, stack.replace("/", "_"))
            values = np.asarray(values[int(view)] if values.ndim == 4 else values, dtype=np.float32)
            found = "sha256:" + hashlib.sha256(values.tobytes()).hexdigest()
            if values.nbytes != int(size) or found != checksum:
                changed.append(name)
        return changed


class Retrieved:
    """A directory of retrieved images: images by name, each [view, row, column], in the units of
    `units`."""

    def __init__(self, path):
        self.path = Path(path)
        self.record = json.loads((self.path / "retrieved.json").read_text())
        self.units = self.record["units"]

    def __getitem__(self, name):
        value = read_stack(self.path / name)
        if value is None:
            raise KeyError(name)
        return value if value.ndim == 3 else value[np.newaxis]

    def flagged(self, bit):
        """Whether a flag is set, [view, row, column]."""
        return self["flags"].astype(int) & int(bit) != 0

    def to_dxchange(self, path, theta):
        """Writes the contrasts of all views as a new DXchange file (HDF5, contiguous, unfiltered).

        theta: angle of each view, degrees. /exchange has the transmission, with a white frame of 1
        and a dark frame of 0; /exchange1 the refraction angle, rad; /exchange2 the dark field, rad^2,
        where the method gives one. Data are [view, row, column], float32, row 0 on top; pixels
        without a result are NaN. ValueError where theta does not fit the views; FileExistsError
        where there is such a file; an error leaves no file behind.
        """
        import h5py

        transmission = np.asarray(self["transmission"], dtype=np.float32)
        theta = np.asarray(theta, dtype=np.float64)
        if theta.shape != transmission.shape[:1] or not np.isfinite(theta).all():
            raise ValueError(
                f"theta: found {theta.size} values of shape {theta.shape}; "
                f"allowed: {len(transmission)} finite angles in degrees, one per view"
            )
        new = Path(f"{path}.part")
        with open(new, "xb"):
            pass
        try:
            with h5py.File(new, "w") as file:
                file["implements"] = "exchange"
                self._exchange(file, "exchange", "transmission", theta)
                frame = (1, *transmission.shape[1:])
                file["exchange/data_white"] = np.ones(frame, dtype=np.float32)
                file["exchange/data_dark"] = np.zeros(frame, dtype=np.float32)
                self._exchange(file, "exchange1", "refraction", theta)
                if "dark_field" in self.units:
                    self._exchange(file, "exchange2", "dark_field", theta)
            os.link(new, path)
        finally:
            new.unlink()

    CONTRASTS = {
        "transmission": "transmission T, 1 without sample",
        "refraction": "refraction angle alpha, positive towards +x",
        "dark_field": "variance of the scattering angle, sigma_DF^2",
    }

    def _exchange(self, file, group, name, theta):
        data = file.create_dataset(f"{group}/data", data=np.asarray(self[name], dtype=np.float32))
        data.attrs["axes"] = "theta:y:x"
        data.attrs["units"] = self.units[name]
        data.attrs["description"] = self.CONTRASTS[name]
        file[f"{group}/title"] = name
        angles = file.create_dataset(f"{group}/theta", data=theta)
        angles.attrs["units"] = "degrees"
