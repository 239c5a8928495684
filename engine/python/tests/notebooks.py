"""Runs notebooks without Jupyter, as continuous integration does, or writes their outputs.

    python notebooks.py [--write] NOTEBOOK...

Cells run in order in one namespace; the value of the last expression of a cell is shown as Jupyter
shows it; stored outputs are not read. `--write` runs them in Jupyter (nbclient, ipykernel) and stores the
outputs in the files, pictures as PNG with 64 colours.
`BEAMLET_QUICK` in the environment makes them small.
"""

from __future__ import annotations

import ast
import base64
import io
import json
import os
import sys
import time
from pathlib import Path


def run(path: Path) -> None:
    """Runs the code cells of a notebook."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    names: dict[str, object] = {"__name__": "__main__"}
    for number, cell in enumerate(notebook["cells"]):
        if cell["cell_type"] != "code":
            continue
        tree = ast.parse("".join(cell["source"]), f"{path.name}, cell {number}")
        last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, f"{path.name}, cell {number}", "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), f"{path.name}, cell {number}", "eval"), names)
            picture = getattr(value, "_repr_png_", lambda: None)()
            print(repr(value) if picture is None else f"a picture of {len(picture)} bytes")


def smaller(picture: str) -> str:
    """A PNG as base64 with 64 colours, a third of the size."""
    from PIL import Image

    out = io.BytesIO()
    colours = Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB")
    colours.quantize(64, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
    return base64.b64encode(out.getvalue()).decode()


def write(path: Path) -> None:
    """Runs a notebook in Jupyter and stores its outputs."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=3000, resources={"metadata": {"path": str(path.parent)}}).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "image/png" in data:
                data["image/png"] = smaller(data["image/png"])
    # Languages of the kernel differ from machine to machine.
    notebook.metadata["language_info"] = {"name": "python"}
    nbformat.write(notebook, path)


def main() -> None:
    words = sys.argv[1:]
    os.environ.setdefault("MPLBACKEND", "agg")
    for path in (Path(word) for word in words if word != "--write"):
        began = time.monotonic()
        if "--write" in words:
            del os.environ["MPLBACKEND"]
            write(path)
            os.environ["MPLBACKEND"] = "agg"
        else:
            run(path)
        print(f"{path.name}: {time.monotonic() - began:.1f} s", flush=True)


if __name__ == "__main__":
    main()
